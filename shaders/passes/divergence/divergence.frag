#version 430
// Divergence maps of several groupings without a compute shader: one fragment for each block of each.
#include "passes/divergence/count.glsl"

layout(location = 0) out uint divergence;

void main() {
    divergence = count_decoders(ivec2(gl_FragCoord.xy));
}
