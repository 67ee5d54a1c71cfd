#version 430
layout(location = 0) out vec4 is_read;

void main() {
    is_read = vec4(1.0);
}
