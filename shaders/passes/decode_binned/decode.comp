#version 430
// Decodes the pixels of one decoder, several in each invocation; dispatched once for each decoder with its own arguments.
#include "generated/layout.glsl"
layout(local_size_x = BIN_GROUP) in;
#include "ntc/decode_pixels.glsl"
#include "passes/decode_binned/bins.glsl"

uniform int bin;

void main() {
    uint count = bins[bin].pixels;
    uint first = gl_WorkGroupID.x * uint(BIN_GROUP * PIXELS) + gl_LocalInvocationID.x;
    if (first >= count) return;
    ivec2 pixels[PIXELS];
    bool inside[PIXELS];
    for (int p = 0; p < PIXELS; ++p) {
        // Neighbours in a work group read neighbours in the list.
        uint place = first + uint(p * BIN_GROUP);
        inside[p] = place < count;
        uint place_on_screen = bin_pixels[bins[bin].first + min(place, count - 1u)];
        pixels[p] = ivec2(place_on_screen & 65535u, place_on_screen >> 16);
    }
    decode_pixels(pixels, inside);
}
