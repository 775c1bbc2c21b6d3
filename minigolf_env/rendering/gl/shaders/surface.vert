// All solid surfaces: the course, the lawn around it, the flag and the ball.
uniform mat4 model;  // from model to world coordinates
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 grain;
out vec3 world_position;
out vec3 world_normal;
out vec3 model_position;
out vec3 grain_direction;

void main() {
    vec4 world = model * vec4(position, 1.0);
    world_position = world.xyz;
    world_normal = mat3(model) * normal;
    model_position = position;
    grain_direction = grain;
    gl_Position = clip_from_world * world;
}
