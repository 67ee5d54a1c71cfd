#version 430
// Writes each pixel into its decoder's part of the list.
layout(local_size_x = 8, local_size_y = 8) in;
#include "common/visibility.glsl"
#include "ntc/plane.glsl"
#include "passes/decode_binned/bins.glsl"

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, textureSize(surface_words, 0)))) return;
    int decoder = surface_decoder(read_surface(pixel));
    if (decoder < 0) return;
    uint place = bins[decoder].first + atomicAdd(bins[decoder].placed, 1u);
    bin_pixels[place] = uint(pixel.x) | (uint(pixel.y) << 16);
}
