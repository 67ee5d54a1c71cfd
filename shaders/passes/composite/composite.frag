#version 430
// Combines slots A and B to one 8-bit sRGB picture.
// SPLIT 1: A on one side of a line, B on the other. DIFFERENCE 1: gain |A - B| of sRGB values, 2: |A - B| / max(A, floor) of
// linear light, 3: the FLIP map. If both are 0: slot A alone.
// OVERLAY 1: shows decoders per block. MARKS 1: colours or dims textures. ZOOM 1: enlarges a part of the picture.
#include "common/color.glsl"
#include "common/visibility.glsl"
#include "generated/layout.glsl"

layout(binding = UNIT_PICTURE_A) uniform sampler2D picture_a;
#if SPLIT || DIFFERENCE
layout(binding = UNIT_PICTURE_B) uniform sampler2D picture_b;
#endif
#if SPLIT
uniform vec3 line;       // normal and distance in window pixels: slot B where dot(pixel, normal) >= distance
uniform float shift;     // window pixels: A is sampled this much further right, B further left
#endif
#if DIFFERENCE == 1
uniform float gain;
#elif DIFFERENCE == 2
uniform float least;     // linear light: lower bound of the divisor
#elif DIFFERENCE == 3
layout(binding = UNIT_FLIP) uniform sampler2D flip_errors;   // 0 to 1
uniform bool flip_is_known;
uniform vec3 flip_palette[PALETTE_STEPS];   // sRGB, from 0 to 1
const vec3 LUMA = vec3(0.299, 0.587, 0.114);
const float UNKNOWN_LIGHT = 0.3;
#endif
#if ZOOM
uniform float zoom;      // window pixels along a side of a picture pixel
uniform vec2 corner;     // lower left corner of the visible part, in picture pixels
#endif
#if OVERLAY || MARKS
uniform float opacity;
uniform vec3 palette[PALETTE_STEPS];   // sRGB
#endif
#if MARKS
struct TextureMark {
    float share;         // position on the palette, -1: no colour
    float light;         // factor: 1 is unchanged
};
layout(std430, binding = BINDING_DECODERS) readonly buffer Marks {
    TextureMark marks[];
};
#endif
#if OVERLAY
layout(binding = UNIT_DIVERGENCE) uniform usampler2D divergence;
uniform ivec2 picture;       // width, height in pixels
uniform ivec2 block;         // width, height in pixels
uniform ivec2 first_rows;    // first rows of A's and B's maps
uniform float most;          // decoders at the hot end of the palette

const float GRID_FROM = 16.0;      // window pixels along the shorter side of a block from which its edges are drawn
const vec3 GRID = vec3(0.0);
const float GRID_OPACITY = 0.45;

ivec2 block_of(ivec2 pixel) {
    return ivec2(pixel.x, picture.y - 1 - pixel.y) / block;
}
#endif

layout(location = 0) out vec4 color;

// A macro: a function would copy the palette.
#define ON_PALETTE(colors, place) mix( \
    colors[min(int(place), PALETTE_STEPS - 2)], \
    colors[min(int(place), PALETTE_STEPS - 2) + 1], \
    (place) - float(min(int(place), PALETTE_STEPS - 2)))

float place_on_palette(float share) {
    return clamp(share, 0.0, 1.0) * float(PALETTE_STEPS - 1);
}

ivec2 picture_pixel(vec2 shown) {
#if ZOOM
    return ivec2(floor(corner + shown / zoom));
#else
    return ivec2(floor(shown));
#endif
}

void main() {
    vec2 shown_pixel = gl_FragCoord.xy;
    bool second = false;
#if SPLIT
    second = dot(shown_pixel, line.xy) >= line.z;
    shown_pixel.x += second ? -shift : shift;
#endif
    ivec2 pixel = picture_pixel(shown_pixel);
    vec3 a = texelFetch(picture_a, pixel, 0).rgb;
#if SPLIT
    if (second) a = texelFetch(picture_b, pixel, 0).rgb;
#endif
#if DIFFERENCE
    vec3 b = texelFetch(picture_b, pixel, 0).rgb;
#endif
#if DIFFERENCE == 1
    vec3 shown = gain * abs(linear_to_srgb(a) - linear_to_srgb(b));
#elif DIFFERENCE == 2
    vec3 shown = abs(a - b) / max(a, least);
#elif DIFFERENCE == 3
    vec3 shown = vec3(UNKNOWN_LIGHT * dot(linear_to_srgb(a), LUMA));
    if (flip_is_known) {
        float error_place = place_on_palette(texelFetch(flip_errors, pixel, 0).r);
        shown = ON_PALETTE(flip_palette, error_place);
    }
#else
    vec3 shown = linear_to_srgb(a);
#endif
#if MARKS
    TextureMark mark = marks[surface_texture(texelFetch(surface_words, pixel, 0).x) + 1];
    float mark_place = place_on_palette(mark.share);
    if (mark.share >= 0.0) shown = mix(shown, ON_PALETTE(palette, mark_place), opacity);
    shown *= mark.light;
#endif
#if OVERLAY
    ivec2 at = block_of(pixel);
    uint decoders = texelFetch(divergence, at + ivec2(0, second ? first_rows.y : first_rows.x), 0).x;
    float place = place_on_palette((float(decoders) - 1.0) / max(most - 1.0, 1.0));
    vec3 heat = ON_PALETTE(palette, place);
    shown = mix(shown, heat, decoders > 0u ? opacity : 0.0);
#if ZOOM
    if (float(min(block.x, block.y)) * zoom >= GRID_FROM) {
        // The window pixels along the right and lower edge of a block.
        bool edge = block_of(picture_pixel(shown_pixel + vec2(1.0, 0.0))) != at
            || block_of(picture_pixel(shown_pixel - vec2(0.0, 1.0))) != at;
        if (edge) shown = mix(shown, GRID, GRID_OPACITY);
    }
#endif
#endif
    color = vec4(shown, 1.0);
}
