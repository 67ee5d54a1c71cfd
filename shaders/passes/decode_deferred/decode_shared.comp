#version 430
// Decodes every visible pixel of a pack with a single decoder, several in each invocation.
layout(local_size_x = 8, local_size_y = 8) in;
#include "ntc/decode_pixels.glsl"

void main() {
    ivec2 pixels[PIXELS];
    bool inside[PIXELS];
    for (int p = 0; p < PIXELS; ++p) {
        ivec2 pixel = ivec2(gl_WorkGroupID.xy) * ivec2(8, 8 * PIXELS) + ivec2(gl_LocalInvocationID.xy) + ivec2(0, 8 * p);
        inside[p] = all(lessThan(pixel, imageSize(albedo)));
        pixels[p] = min(pixel, imageSize(albedo) - 1);
    }
    decode_pixels(pixels, inside);
}
