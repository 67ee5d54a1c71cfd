#version 430
// Divergence maps of several groupings, and their histograms of decoders per block. One invocation per block and grouping.
#include "passes/divergence/count.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;
layout(std430, binding = BINDING_RESULTS) buffer Histogram {
    uint blocks_with[];   // for each grouping BLOCK_WIDTH * BLOCK_HEIGHT + 1 counts
};
layout(r32ui, binding = IMAGE_DIVERGENCE) uniform writeonly uimage2D divergence;

void main() {
    ivec2 place = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(place, imageSize(divergence)))) return;
    uint count = count_decoders(place);
    imageStore(divergence, place, uvec4(count));
    atomicAdd(blocks_with[(place.y / rows) * (BLOCK_WIDTH * BLOCK_HEIGHT + 1) + int(count)], 1u);
}
