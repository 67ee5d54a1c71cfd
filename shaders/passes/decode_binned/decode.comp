#version 430
// Decodes the pixels of one decoder, several in each invocation. Each decoder has a dispatch.
#include "generated/layout.glsl"
layout(local_size_x = BIN_GROUP) in;
#include "ntc/decode_pixels.glsl"
#include "passes/decode_binned/bins.glsl"
#include "common/work_groups.glsl"

uniform int bin;

// Neighbouring invocations read neighbouring entries of the list.
ivec2 pixel_of(int p, out bool inside) {
    uint count = bins[bin].pixels;
    uint place = work_group_number() * uint(BIN_GROUP * PIXELS) + gl_LocalInvocationID.x + uint(p * BIN_GROUP);
    inside = place < count;
    uint place_on_screen = bin_pixels[bins[bin].first + min(place, count - 1u)];
    return ivec2(place_on_screen & 65535u, place_on_screen >> 16);
}

void main() {
    decode_pixels();
}
