#version 430
// Shadow map: depth seen from the sun, with holes in cut-out and blended materials.
// ALPHA_TEST 1: reads the material's alpha.
#if ALPHA_TEST
#include "common/materials.glsl"
#include "common/noise.glsl"
#include "common/surface.glsl"
#include "common/wrap.glsl"

in vec3 place;
#if VERTEX_COLORS
in vec4 color;
#else
const vec4 color = vec4(1.0);
#endif
flat in uint ids;

layout(binding = UNIT_ALPHA) uniform sampler2D alpha_texture;

void main() {
    vec2 uv = place.xy;
    vec2 step_x = dFdx(uv);
    vec2 step_y = dFdy(uv);
    MaterialRecord material = materials[surface_material(ids)];
    PlaneRecord base = materials[surface_material(ids)].planes[PLANE_BASE];
    vec2 at = vec2(wrap_coordinate(uv.x, base.wrap_u), wrap_coordinate(uv.y, base.wrap_v));
    float alpha = material.factor.a * color.a * textureGrad(alpha_texture, at, step_x, step_y).r;
    // Alpha hashing: a blended surface covers a share of the texels that equals its alpha.
    uint threshold = pixel_noise(uvec2(gl_FragCoord.xy));
    if (material.alpha_mode == ALPHA_BLEND ? !is_covered(alpha, threshold) : alpha < material.alpha_cutoff) discard;
}
#else
void main() {
}
#endif
