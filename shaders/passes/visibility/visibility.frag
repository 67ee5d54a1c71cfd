#version 430
// Writes the visibility buffer. Nothing is shaded here; hidden surfaces cost one depth test.
#include "common/materials.glsl"
#include "common/surface.glsl"
#include "common/wrap.glsl"

in vec3 place;
#if VERTEX_COLORS
in vec4 color;
#else
const vec4 color = vec4(1.0);
#endif
flat in uint ids;

layout(location = 0) out uvec4 words;
#if VERTEX_COLORS
layout(location = 1) out uint packed_color;
#endif
#if GRADIENTS && VERTEX_COLORS
layout(location = 2) out vec4 gradients;
#elif GRADIENTS
layout(location = 1) out vec4 gradients;
#endif

#if ALPHA_TEST
layout(binding = UNIT_ALPHA) uniform sampler2D alpha_texture;

// A fixed pattern of thresholds over the picture, so that a blended surface covers its share of the pixels
// (interleaved gradient noise, Jimenez 2014).
float threshold(vec2 pixel) {
    return fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715))));
}
#endif

void main() {
    vec2 uv = place.xy;
    vec3 step_x = dFdx(place);
    vec3 step_y = dFdy(place);
#if ALPHA_TEST
    MaterialRecord material = materials[surface_material(ids)];
    vec2 at = vec2(wrap_coordinate(uv.x, material.wrap_u), wrap_coordinate(uv.y, material.wrap_v));
    float alpha = material.factor.a * color.a * textureGrad(alpha_texture, at, step_x.xy, step_y.xy).r;
    if (alpha < (material.alpha_mode == ALPHA_BLEND ? threshold(gl_FragCoord.xy) : material.alpha_cutoff)) discard;
#endif
    words = pack_surface(ids, uv, pixel_footprint(step_x.xz, step_y.xz));
#if VERTEX_COLORS
    packed_color = pack_color(color.rgb);
#endif
#if GRADIENTS
    gradients = vec4(step_x.xy, step_y.xy);
#endif
}
