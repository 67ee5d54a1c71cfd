#version 430
// Slot A left of the divider, slot B right of it, as 8-bit sRGB. WIPE 0: slot A alone. OVERLAY 1: decoders per block over it.
#include "common/color.glsl"
#include "generated/layout.glsl"

layout(binding = UNIT_ALBEDO_A) uniform sampler2D albedo_a;
#if WIPE
layout(binding = UNIT_ALBEDO_B) uniform sampler2D albedo_b;
uniform float divider;   // pixels from the left
#endif
#if OVERLAY
layout(binding = UNIT_DIVERGENCE_A) uniform usampler2D divergence_a;
layout(binding = UNIT_DIVERGENCE_B) uniform usampler2D divergence_b;
uniform ivec2 picture;   // width, height in pixels
uniform ivec2 block;     // width, height in pixels
uniform float most;      // decoders at the hot end of the scale
uniform float opacity;

// Green for one decoder, yellow half way, red for the most (the paper's Fig. 1 colours).
vec3 heat(float value) {
    return vec3(min(1.0, 2.0 * value), min(1.0, 2.0 - 2.0 * value), 0.0);
}
#endif

layout(location = 0) out vec4 color;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 albedo = texelFetch(albedo_a, pixel, 0);
#if WIPE
    if (gl_FragCoord.x >= divider) albedo = texelFetch(albedo_b, pixel, 0);
#endif
    vec3 shown = linear_to_srgb(albedo.rgb);
#if OVERLAY
    ivec2 at = ivec2(pixel.x, picture.y - 1 - pixel.y) / block;
    uint decoders = texelFetch(divergence_a, at, 0).x;
#if WIPE
    if (gl_FragCoord.x >= divider) decoders = texelFetch(divergence_b, at, 0).x;
#endif
    float share = decoders > 0u ? opacity : 0.0;
    shown = mix(shown, heat(clamp((float(decoders) - 1.0) / max(most - 1.0, 1.0), 0.0, 1.0)), share);
#endif
    color = vec4(shown, 1.0);
}
