// Bands on the ground: trails, arrows, predicted paths.
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 tint;
out vec4 shade;

void main() {
    shade = tint;
    gl_Position = clip_from_world * vec4(position, 1.0);
}
