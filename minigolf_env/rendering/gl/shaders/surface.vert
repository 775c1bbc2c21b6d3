// Everything solid: the course, the lawn around it, the flag and the ball.
uniform mat4 model;
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 grain;
out vec3 place;
out vec3 facing;
out vec3 own;    // in the model's own coordinates
out vec3 fibre;

void main() {
    vec4 world = model * vec4(position, 1.0);
    place = world.xyz;
    facing = mat3(model) * normal;
    own = position;
    fibre = grain;
    gl_Position = clip_from_world * world;
}
