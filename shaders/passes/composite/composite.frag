#version 430
// Slot A left of the divider, slot B right of it, as 8-bit sRGB.
#include "common/color.glsl"
#include "generated/layout.glsl"

layout(binding = UNIT_ALBEDO_A) uniform sampler2D albedo_a;
layout(binding = UNIT_ALBEDO_B) uniform sampler2D albedo_b;
uniform float divider;   // pixels from the left; negative shows B alone

layout(location = 0) out vec4 color;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 albedo = gl_FragCoord.x < divider ? texelFetch(albedo_a, pixel, 0) : texelFetch(albedo_b, pixel, 0);
    color = vec4(linear_to_srgb(albedo.rgb), 1.0);
}
