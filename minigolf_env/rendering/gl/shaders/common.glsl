#version 330 core
// Uniforms of a frame, shared by all programs. Metres, world coordinates, z up.
layout(std140) uniform FrameUniforms {
    mat4 clip_from_world;
    mat4 sun_from_world;  // to texture coordinates and depth of the sun's shadow map
    mat4 sky_from_world;  // to texture coordinates and depth of the sky's shadow map, seen from straight above
    vec4 eye;             // position of the camera
    vec4 ball;            // centre; w: radius
    vec4 flag;            // foot of the pole; w: height of the pole (0: no flag)
    vec4 cloth;           // xy: unit vector along the flag's cloth; z: its length; w: its width
    vec4 cup;             // centre of the rim; w: radius (0: no cup)
    vec4 center;          // centre of the course
    vec4 ground;          // height of the lawn, radius of the course, greatest depths of the sun's and the sky's maps
};

const float PI = 3.14159265;
