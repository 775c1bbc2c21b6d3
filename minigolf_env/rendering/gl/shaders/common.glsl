#version 330 core
// Uniforms of a frame, shared by all programs. Metres, world coordinates, z up.
layout(std140) uniform FrameUniforms {
    mat4 clip_from_world;
    mat4 sun_from_world;  // to texture coordinates and depth of the sun's shadow map
    mat4 sky_from_world;  // to texture coordinates and depth of the sky's shadow map, seen from straight above
    vec4 eye;             // position of the camera
    vec4 sun;             // unit vector to the sun
    vec4 ball;            // centre; w: radius
    vec4 flag;            // foot of the pole; w: height of the pole (0: no flag)
    vec4 cloth;           // xy: unit vector along the flag's cloth; z: its length; w: its width
    vec4 cup;             // centre of the rim; w: radius (0: no cup)
    vec4 center;          // centre of the course
    vec4 ground;          // height of the lawn, radius of the course, greatest depths of the sun's and the sky's maps
};

const vec3 SUNLIGHT = vec3(1.30, 1.22, 1.08);     // direct light; all three are linear RGB
const vec3 SKYLIGHT = vec3(0.40, 0.47, 0.58);     // ambient light from above
const vec3 GROUNDLIGHT = vec3(0.20, 0.19, 0.15);  // ambient light from below
const float PI = 3.14159265;
