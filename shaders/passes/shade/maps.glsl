// Reads the maps of a pixel's material from the targets of planes. There may be two sets of targets, as for slots A and B.
// SURFACE_PLANE, EMISSION_PLANE, OTHER_SURFACE_PLANE, OTHER_EMISSION_PLANE 1: the set has that plane; else its maps are neutral.
// MIXED 1: maps whose bit is set in `other_maps` come from the other set.
#include "generated/layout.glsl"

layout(binding = UNIT_PLANE_BASE) uniform sampler2D plane_base;
layout(binding = UNIT_PLANE_SURFACE) uniform sampler2D plane_surface;
layout(binding = UNIT_PLANE_EMISSION) uniform sampler2D plane_emission;
#if MIXED
layout(binding = UNIT_OTHER_BASE) uniform sampler2D other_base;
layout(binding = UNIT_OTHER_SURFACE) uniform sampler2D other_surface;
layout(binding = UNIT_OTHER_EMISSION) uniform sampler2D other_emission;
uniform int other_maps;
#endif

struct Maps {
    vec3 base;      // linear, times factor and vertex colour
    vec4 surface;   // normal x and y as (n + 1) / 2, roughness, metalness
    vec4 emission;  // linear emissive RGB, occlusion
};

Maps read_maps(ivec2 pixel) {
    Maps maps = Maps(texelFetch(plane_base, pixel, 0).rgb, NEUTRAL_SURFACE, NEUTRAL_EMISSION);
#if SURFACE_PLANE
    maps.surface = texelFetch(plane_surface, pixel, 0);
#endif
#if EMISSION_PLANE
    maps.emission = texelFetch(plane_emission, pixel, 0);
#endif
#if MIXED
    vec4 surface = NEUTRAL_SURFACE;
    vec4 emission = NEUTRAL_EMISSION;
#if OTHER_SURFACE_PLANE
    surface = texelFetch(other_surface, pixel, 0);
#endif
#if OTHER_EMISSION_PLANE
    emission = texelFetch(other_emission, pixel, 0);
#endif
    if ((other_maps & MAP_BASE) != 0) maps.base = texelFetch(other_base, pixel, 0).rgb;
    if ((other_maps & MAP_NORMAL) != 0) maps.surface.NORMAL_COMPONENTS = surface.NORMAL_COMPONENTS;
    if ((other_maps & MAP_ROUGHNESS) != 0) maps.surface.ROUGHNESS_COMPONENTS = surface.ROUGHNESS_COMPONENTS;
    if ((other_maps & MAP_METALNESS) != 0) maps.surface.METALNESS_COMPONENTS = surface.METALNESS_COMPONENTS;
    if ((other_maps & MAP_EMISSIVE) != 0) maps.emission.EMISSIVE_COMPONENTS = emission.EMISSIVE_COMPONENTS;
    if ((other_maps & MAP_OCCLUSION) != 0) maps.emission.OCCLUSION_COMPONENTS = emission.OCCLUSION_COMPONENTS;
#endif
    return maps;
}
