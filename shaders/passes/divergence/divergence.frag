#version 430
// Divergence maps of several groupings without compute shaders: one fragment per block and grouping.
#include "passes/divergence/count.glsl"

layout(location = 0) out uint divergence;

void main() {
    divergence = count_decoders(ivec2(gl_FragCoord.xy));
}
