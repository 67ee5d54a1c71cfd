#version 430
// Counts the pixels of each decoder, and writes what pixels without one show.
layout(local_size_x = 8, local_size_y = 8) in;
#include "common/visibility.glsl"
#include "ntc/plane.glsl"
#include "passes/decode_binned/bins.glsl"

layout(rgba32f, binding = IMAGE_TARGET) uniform writeonly image2D target;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(target)))) return;
    Surface surface = read_surface(pixel);
    int decoder = surface_decoder(surface);
    if (decoder >= 0) {
        atomicAdd(bins[decoder].counted, 1u);
    } else {
        imageStore(target, pixel, plane_content(surface, 0, vec4(0.0)));
    }
}
