#version 430
// Slot A left of the divider, slot B right of it, as 8-bit sRGB. WIPE 0: slot A alone.
#include "common/color.glsl"
#include "generated/layout.glsl"

layout(binding = UNIT_ALBEDO_A) uniform sampler2D albedo_a;
#if WIPE
layout(binding = UNIT_ALBEDO_B) uniform sampler2D albedo_b;
uniform float divider;   // pixels from the left
#endif

layout(location = 0) out vec4 color;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 albedo = texelFetch(albedo_a, pixel, 0);
#if WIPE
    if (gl_FragCoord.x >= divider) albedo = texelFetch(albedo_b, pixel, 0);
#endif
    color = vec4(linear_to_srgb(albedo.rgb), 1.0);
}
