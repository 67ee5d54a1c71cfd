#version 430
// Writes what is seen. Nothing is shaded here; hidden surfaces cost one depth test.
#include "common/materials.glsl"
#include "common/surface.glsl"
#include "common/wrap.glsl"

in vec2 uv;
in vec4 color;
flat in int material_index;

layout(location = 0) out uvec4 first;
layout(location = 1) out uvec2 second;

#if ALPHA_TEST
layout(binding = UNIT_ALPHA) uniform sampler2D alpha_texture;

// A fixed pattern of thresholds over the picture, so that a blended surface covers its share of the pixels
// (interleaved gradient noise, Jimenez 2014).
float threshold(vec2 pixel) {
    return fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715))));
}
#endif

void main() {
    MaterialRecord material = materials[material_index];
    vec2 gradient_x = dFdx(uv);
    vec2 gradient_y = dFdy(uv);
#if ALPHA_TEST
    vec2 at = vec2(wrap_coordinate(uv.x, material.wrap_u), wrap_coordinate(uv.y, material.wrap_v));
    float alpha = material.factor.a * color.a * textureGrad(alpha_texture, at, gradient_x, gradient_y).r;
    if (alpha < (material.alpha_mode == ALPHA_BLEND ? threshold(gl_FragCoord.xy) : material.alpha_cutoff)) discard;
#endif
    pack_surface(Surface(material.texture_id, material_index, uv, gradient_x, gradient_y, color.rgb), first, second);
}
