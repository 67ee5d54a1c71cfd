#version 430
// Counts the pixels of each decoder, and writes the colour of pixels without one.
layout(local_size_x = 8, local_size_y = 8) in;
#include "common/visibility.glsl"
#include "ntc/plane.glsl"
#include "passes/decode_binned/bins.glsl"
#include "passes/decode_binned/group_bins.glsl"

layout(rgba32f, binding = IMAGE_TARGET) uniform writeonly image2D target;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    int decoder = -1;
    if (all(lessThan(pixel, imageSize(target)))) {
        Surface surface = read_surface(pixel);
        decoder = surface_decoder(surface);
        if (decoder < 0) imageStore(target, pixel, plane_content(surface, 0, vec4(0.0)));
    }
#if SHARED_SUMS
    uint slot;
    add_to_group(decoder, slot);
    uint count = group_count[gl_LocalInvocationIndex];
    if (count > 0u) atomicAdd(bins[group_bin[gl_LocalInvocationIndex]].counted, count);
#else
    if (decoder >= 0) atomicAdd(bins[decoder].counted, 1u);
#endif
}
