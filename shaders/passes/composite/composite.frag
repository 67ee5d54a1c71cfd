#version 430
// Slot A left of the divider, slot B right of it, as 8-bit sRGB. WIPE 0: slot A alone. OVERLAY 1: decoders per block over it.
#include "common/color.glsl"
#include "generated/layout.glsl"

layout(binding = UNIT_ALBEDO_A) uniform sampler2D albedo_a;
#if WIPE
layout(binding = UNIT_ALBEDO_B) uniform sampler2D albedo_b;
uniform float divider;   // pixels from the left
#endif
#if ZOOM
uniform float zoom;      // shown pixels along a side of a pixel of the picture
uniform vec2 corner;     // lower left corner of what is shown, in pixels of the picture
#endif
#if OVERLAY
layout(binding = UNIT_DIVERGENCE) uniform usampler2D divergence;
uniform ivec2 picture;       // width, height in pixels
uniform ivec2 block;         // width, height in pixels
uniform ivec2 first_rows;    // first rows of A's and B's maps
uniform float most;          // decoders at the hot end of the palette
uniform float opacity;
uniform vec3 palette[PALETTE_STEPS];   // sRGB, from one decoder to the most

const float GRID_FROM = 16.0;      // shown pixels along the shorter side of a block from which its edges are drawn
const vec3 GRID = vec3(0.0);
const float GRID_OPACITY = 0.45;

ivec2 block_of(ivec2 pixel) {
    return ivec2(pixel.x, picture.y - 1 - pixel.y) / block;
}
#endif

layout(location = 0) out vec4 color;

ivec2 picture_pixel(ivec2 shown) {
#if ZOOM
    return ivec2(floor(corner + (vec2(shown) + 0.5) / zoom));
#else
    return shown;
#endif
}

void main() {
    ivec2 pixel = picture_pixel(ivec2(gl_FragCoord.xy));
    vec4 albedo = texelFetch(albedo_a, pixel, 0);
#if WIPE
    bool second = gl_FragCoord.x >= divider;
    if (second) albedo = texelFetch(albedo_b, pixel, 0);
#else
    bool second = false;
#endif
    vec3 shown = linear_to_srgb(albedo.rgb);
#if OVERLAY
    ivec2 at = block_of(pixel);
    uint decoders = texelFetch(divergence, at + ivec2(0, second ? first_rows.y : first_rows.x), 0).x;
    float share = clamp((float(decoders) - 1.0) / max(most - 1.0, 1.0), 0.0, 1.0) * float(PALETTE_STEPS - 1);
    int low = min(int(share), PALETTE_STEPS - 2);
    vec3 heat = mix(palette[low], palette[low + 1], share - float(low));
    shown = mix(shown, heat, decoders > 0u ? opacity : 0.0);
#if ZOOM
    if (float(min(block.x, block.y)) * zoom >= GRID_FROM) {
        // The last shown pixel of a block, to the right and below.
        bool edge = block_of(picture_pixel(ivec2(gl_FragCoord.xy) + ivec2(1, 0))) != at
            || block_of(picture_pixel(ivec2(gl_FragCoord.xy) - ivec2(0, 1))) != at;
        if (edge) shown = mix(shown, GRID, GRID_OPACITY);
    }
#endif
#endif
    color = vec4(shown, 1.0);
}
