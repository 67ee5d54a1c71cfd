#version 430
// Samples a plane from decoded tiles. Hardware filters within a level, the shader blends two levels, and long footprints take several probes.
#include "passes/decode_cached/tiles.glsl"

layout(binding = UNIT_ATLAS) uniform sampler2DArray atlas;
layout(location = 0) out vec4 target;

// Texel in linear light to show until a texture has its first decoded tile.
const vec4 MISSING_TEXEL = PLANE == PLANE_BASE ? vec4(0.2) : (PLANE == PLANE_SURFACE ? vec4(0.5, 0.5, 1.0, 1.0) : vec4(vec3(0.0), 1.0));

vec4 sample_page(uint page, vec2 at) {
    uvec2 corner = uvec2(page % uint(PAGES_ACROSS), (page / uint(PAGES_ACROSS)) % uint(PAGES_ACROSS)) * uint(PAGE_SIDE);
    // The division is exact, so no filter reads a texel of another page.
    vec2 uv = (vec2(corner) + at) / float(ATLAS_SIDE);
    return textureLod(atlas, vec3(uv, float(page / uint(PAGES_ACROSS * PAGES_ACROSS))), 0.0);
}

// Samples `level`, or the next coarser level whose tile is resident.
vec4 sample_level(int first, WantedTexel wanted, int level, vec2 uv) {
    int last = textures[wanted.texture_id].levels - 1;
    for (int resident = level; resident <= last; ++resident) {
        TilePlace place = tile_place(first, wanted, resident, uv);
        uint entry = tile_entries[place.entry];
        if (is_resident(entry)) return sample_page(entry - 1u, place.at);
    }
    return MISSING_TEXEL;
}

void main() {
    Surface surface = read_surface(ivec2(gl_FragCoord.xy));
    WantedTexel wanted = wanted_texel(surface);
    vec4 texel = vec4(1.0);
    if (wanted.texture_id >= 0) {
        int first = material_tiles[surface.material];
        Probes probes = probes_of(ivec2(gl_FragCoord.xy), wanted, materials[surface.material].planes[PLANE]);
        FilterLevels filtered = filter_levels(wanted.texture_id, probes.lod);
        vec4 sum = vec4(0.0);
        for (int number = 0; number < probes.count; ++number) {
            vec2 uv = wrapped_place(wanted, probe_offset(probes, number));
            vec4 sampled = sample_level(first, wanted, filtered.lower, uv);
            if (filtered.share > 0.0)
                sampled = mix(sampled, sample_level(first, wanted, filtered.upper, uv), filtered.share);
            sum += sampled;
        }
        texel = sum / float(probes.count);
    }
    target = plane_content(surface, wanted.components, texel);
}
