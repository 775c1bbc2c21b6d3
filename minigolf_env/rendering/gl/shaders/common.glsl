#version 330 core
// What every program knows of a frame. Metres, world coordinates, z up.
layout(std140) uniform Frame {
    mat4 clip_from_world;
    mat4 sun_from_world;  // to the texture coordinates and the depth of the sun's shadow map
    mat4 sky_from_world;  // the same, looking straight down
    vec4 eye;
    vec4 sun;             // unit vector to the sun
    vec4 ball;            // centre, radius
    vec4 flag;            // foot of the pole, its height (0: no flag)
    vec4 cloth;           // unit vector along the cloth (x, y), its length, its width
    vec4 cup;             // centre of the rim, radius (0: no cup)
    vec4 middle;          // of the course
    vec4 ground;          // level of the lawn, radius of the course, greatest depths of the sun's and the sky's maps
};

const vec3 SUNLIGHT = vec3(1.30, 1.22, 1.08);
const vec3 SKYLIGHT = vec3(0.40, 0.47, 0.58);
const vec3 BOUNCED = vec3(0.20, 0.19, 0.15);
const vec3 HAZE = vec3(0.62, 0.72, 0.80);
const float PI = 3.14159265;
