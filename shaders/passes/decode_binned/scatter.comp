#version 430
// Writes each pixel into its decoder's part of the list.
layout(local_size_x = 8, local_size_y = 8) in;
#include "common/visibility.glsl"
#include "ntc/plane.glsl"
#include "passes/decode_binned/bins.glsl"
#include "passes/decode_binned/group_bins.glsl"

#if SHARED_SUMS
shared uint group_first[GROUP_PIXELS];    // place of each slot's first pixel in the list
#endif

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    int decoder = all(lessThan(pixel, textureSize(surface_words, 0))) ? surface_decoder(read_surface(pixel)) : -1;
#if SHARED_SUMS
    uint slot;
    uint place = add_to_group(decoder, slot);
    uint count = group_count[gl_LocalInvocationIndex];
    if (count > 0u) {
        uint bin = group_bin[gl_LocalInvocationIndex];
        group_first[gl_LocalInvocationIndex] = bins[bin].first + atomicAdd(bins[bin].placed, count);
    }
    barrier();
    place += group_first[slot];
#else
    uint place = decoder >= 0 ? bins[decoder].first + atomicAdd(bins[decoder].placed, 1u) : 0u;
#endif
    if (decoder >= 0) bin_pixels[place] = uint(pixel.x) | (uint(pixel.y) << 16);
}
