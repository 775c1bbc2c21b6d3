uniform mat4 model;  // from world to clip coordinates of the light
layout(location = 0) in vec3 position;

void main() { gl_Position = model * vec4(position, 1.0); }
