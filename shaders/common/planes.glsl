// The planes of materials' maps (ntc/codec/maps.py): where a surface reads them, and the content of their targets.
#include "common/materials.glsl"
#include "common/surface.glsl"

// The plane to draw.
#ifndef PLANE
#define PLANE PLANE_BASE
#endif

// uv at which a plane's maps are read (xy), and the footprint there (z).
vec3 place_on_plane(PlaneRecord plane, Surface surface) {
    vec3 place = vec3(surface.uv, surface.footprint);
    if (PLANE == PLANE_BASE) return place;
#if SECOND_UVS
    if (plane.second_uvs != 0) place = surface.second_uv;
#endif
    float area = abs(plane.uv_u.x * plane.uv_v.y - plane.uv_u.y * plane.uv_v.x);
    return vec3(plane_uv(plane, place.xy), place.z * sqrt(area));
}

// Checkerboard in place of an image that could not be read, with MISSING_SQUARES squares a side. It fades to one colour with distance.
const float MISSING_SQUARES = 8.0;
vec3 missing_image(Surface surface) {
    vec2 square = floor(surface.uv * MISSING_SQUARES);
    float odd = mod(square.x + square.y, 2.0);
    odd = mix(odd, 0.5, smoothstep(0.3, 1.0, surface.footprint * MISSING_SQUARES));
    return mix(vec3(0.05), vec3(0.45, 0.03, 0.45), odd);
}

// Linear factor of a surface's base colour; without a texture it is the base colour. Black for the background.
vec3 base_factor(Surface surface) {
    if (surface.material < 0) return vec3(0.0);
    vec3 factor = materials[surface.material].factor.rgb * surface.color;
    return materials[surface.material].missing_base == 0 ? factor : factor * missing_image(surface);
}

// Content of the plane's target for a texel in linear light. `components` has a bit for each component that the texel holds; the others
// become neutral.
vec4 plane_content(Surface surface, int components, vec4 texel) {
    if (PLANE == PLANE_BASE) {
        vec3 factor = base_factor(surface);
        return vec4(components == 0 ? factor : factor * texel.rgb, surface.material >= 0 ? 1.0 : 0.0);
    }
    vec4 neutral = PLANE == PLANE_SURFACE ? vec4(0.5, 0.5, 1.0, 1.0) : vec4(1.0);
    return mix(neutral, texel, notEqual(ivec4(components) & ivec4(1, 2, 4, 8), ivec4(0)));
}
