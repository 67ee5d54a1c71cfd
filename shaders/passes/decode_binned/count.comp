#version 430
// Counts the pixels of each decoder, and writes the albedo of pixels without one.
layout(local_size_x = 8, local_size_y = 8) in;
#include "common/visibility.glsl"
#include "ntc/albedo.glsl"
#include "passes/decode_binned/bins.glsl"

layout(rgba32f, binding = IMAGE_ALBEDO) uniform writeonly image2D albedo;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(albedo)))) return;
    Surface surface = read_surface(pixel);
    int decoder = surface_decoder(surface);
    if (decoder >= 0) {
        atomicAdd(bins[decoder].counted, 1u);
    } else {
        imageStore(albedo, pixel, vec4(wanted_texel(surface).factor, surface.material >= 0 ? 1.0 : 0.0));
    }
}
