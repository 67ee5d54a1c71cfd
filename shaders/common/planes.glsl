// The planes of materials' maps (ntc/codec/maps.py): where a surface reads one, and what a plane's target holds.
#include "common/materials.glsl"
#include "common/surface.glsl"

// The plane that is drawn.
#ifndef PLANE
#define PLANE PLANE_BASE
#endif

// uv of a plane's maps, and the footprint there.
vec3 place_on_plane(PlaneRecord plane, Surface surface) {
    vec3 place = vec3(surface.uv, surface.footprint);
    if (PLANE == PLANE_BASE) return place;
#if SECOND_UVS
    if (plane.second_uvs != 0) place = surface.second_uv;
#endif
    float area = abs(plane.uv_u.x * plane.uv_v.y - plane.uv_u.y * plane.uv_v.x);
    return vec3(plane_uv(plane, place.xy), place.z * sqrt(area));
}

// Squares that stand for an image that could not be read: MISSING_SQUARES along each side of it, of one colour where a pixel holds many.
const float MISSING_SQUARES = 8.0;
vec3 missing_image(Surface surface) {
    vec2 square = floor(surface.uv * MISSING_SQUARES);
    float odd = mod(square.x + square.y, 2.0);
    odd = mix(odd, 0.5, smoothstep(0.3, 1.0, surface.footprint * MISSING_SQUARES));
    return mix(vec3(0.05), vec3(0.45, 0.03, 0.45), odd);
}

// Factor of a surface's base colour, linear: the base colour itself where there is no texture. Black for the background.
vec3 base_factor(Surface surface) {
    if (surface.material < 0) return vec3(0.0);
    vec3 factor = materials[surface.material].factor.rgb * surface.color;
    return materials[surface.material].missing_base == 0 ? factor : factor * missing_image(surface);
}

// Content of the plane's target for a texel in linear light. `components` has a bit for each component that the texel tells; the others
// are neutral.
vec4 plane_content(Surface surface, int components, vec4 texel) {
    if (PLANE == PLANE_BASE) {
        vec3 factor = base_factor(surface);
        return vec4(components == 0 ? factor : factor * texel.rgb, surface.material >= 0 ? 1.0 : 0.0);
    }
    vec4 neutral = PLANE == PLANE_SURFACE ? vec4(0.5, 0.5, 1.0, 1.0) : vec4(1.0);
    return mix(neutral, texel, notEqual(ivec4(components) & ivec4(1, 2, 4, 8), ivec4(0)));
}
