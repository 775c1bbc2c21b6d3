// Lines on the ground: trails, arrows, predicted paths.
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 vertex_color;
out vec4 line_color;

void main() {
    line_color = vertex_color;
    gl_Position = clip_from_world * vec4(position, 1.0);
}
