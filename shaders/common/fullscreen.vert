#version 430
// One triangle that covers the picture, at depth `depth` in [0, 1].
uniform float depth;

void main() {
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(corner * 2.0 - 1.0, depth * 2.0 - 1.0, 1.0);
}
