#version 430
// Decodes each visible pixel of a pack with a single decoder, several pixels in each invocation.
layout(local_size_x = 8, local_size_y = 8) in;
#include "ntc/decode_pixels.glsl"

ivec2 pixel_of(int p, out bool inside) {
    ivec2 pixel = ivec2(gl_WorkGroupID.xy) * ivec2(8, 8 * PIXELS) + ivec2(gl_LocalInvocationID.xy) + ivec2(0, 8 * p);
    inside = all(lessThan(pixel, imageSize(target)));
    return min(pixel, imageSize(target) - 1);
}

void main() {
    decode_pixels();
}
