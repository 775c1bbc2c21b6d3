uniform mat4 clip_from_place;
layout(location = 0) in vec3 position;

void main() { gl_Position = clip_from_place * vec4(position, 1.0); }
