// Lookup of the decoded tiles that a surface reads.
#include "common/visibility.glsl"
#include "common/wrap.glsl"
#include "ntc/plane.glsl"

// For each material the first of its texture's TileLevelRecords under its wrap modes; -1 for none.
layout(std430, binding = BINDING_MATERIAL_TILES) readonly buffer MaterialTiles {
    int material_tiles[];
};
layout(std430, binding = BINDING_TILE_LEVELS) readonly buffer TileLevels {
    TileLevelRecord tile_levels[];
};
layout(std430, binding = BINDING_TILE_ENTRIES) buffer TileEntries {
    uint tile_entries[];
};

struct TilePlace {
    int entry;     // in tile_entries
    vec2 at;       // texels from the corner of its page
};

#if GRADIENTS
uniform int anisotropy;   // most probes along the longer side of a footprint
#endif

// Trilinear samples along a pixel's footprint (EXT_texture_filter_anisotropic): one where it is about as long as wide.
struct Probes {
    int count;
    vec2 step;     // uv from one to the next
    float lod;     // of each
};

Probes probes_of(ivec2 pixel, WantedTexel wanted, PlaneRecord plane) {
    Probes probes = Probes(1, vec2(0.0), wanted.lod);
#if GRADIENTS
    // Only the footprint is known of the other UV set.
    if (anisotropy > 1 && plane.sampler_flags == 0 && plane.second_uvs == 0) {
        LevelRecord finest = levels[textures[wanted.texture_id].first_level];
        vec2 size = vec2(finest.texel_width, finest.texel_height);
        vec4 gradients = texelFetch(surface_gradients, pixel, 0);
#if PLANE != PLANE_BASE
        gradients = vec4(plane_uv_step(plane, gradients.xy), plane_uv_step(plane, gradients.zw));
#endif
        float along_x = length(gradients.xy * size);
        float along_y = length(gradients.zw * size);
        float longer = max(along_x, along_y);
        // False for NaN, too.
        if (longer > 1.0 && longer < 1e10) {
            probes.count = int(clamp(ceil(longer / max(min(along_x, along_y), 1e-10) - 1e-4), 1.0, float(anisotropy)));
            probes.step = (along_x >= along_y ? gradients.xy : gradients.zw) / float(probes.count + 1);
            probes.lod = log2(longer / float(probes.count));
        }
    }
#endif
    return probes;
}

vec2 probe_offset(Probes probes, int number) {
    return probes.step * (float(number + 1) - 0.5 * float(probes.count + 1));
}

// The mip levels that a trilinear filter reads, and the weight of the second.
struct FilterLevels {
    int lower;
    int upper;
    float share;
};

FilterLevels filter_levels(int texture_id, float wanted_lod) {
    float last = float(textures[texture_id].levels - 1);
    float lod = is_finite(wanted_lod) ? clamp(wanted_lod, 0.0, last) : 0.0;
    int lower = int(floor(lod));
    return FilterLevels(lower, min(lower + 1, int(last)), lod - float(lower));
}

vec2 wrapped_place(WantedTexel wanted, vec2 offset) {
    vec2 uv = wanted.uv + offset;
    return vec2(wrap_coordinate(uv.x, wanted.wrap.x), wrap_coordinate(uv.y, wanted.wrap.y));
}

// A place along a side of `size` texels, which lies on the texture, where a filter reads what it reads at `place`, and no texel before
// the first one. Only under `repeat` does it read one beyond the last, which is the first one then.
float filtered_place(float place, float size, int wrap) {
    return wrap == WRAP_REPEAT ? (place < 0.5 ? place + size : place) : clamp(place, 0.5, size - 0.5);
}

// The tile that holds the first of the four texels that a filter reads. `first` is the material's first TileLevelRecord, `uv` is wrapped.
TilePlace tile_place(int first, WantedTexel wanted, int level, vec2 uv) {
    LevelRecord record = levels[textures[wanted.texture_id].first_level + level];
    ivec2 size = ivec2(record.texel_width, record.texel_height);
    vec2 texels = uv * vec2(size);
    vec2 place = vec2(
        filtered_place(texels.x, float(size.x), wanted.wrap.x),
        filtered_place(texels.y, float(size.y), wanted.wrap.y)
    );
    // A sum may be rounded up to the texel beyond the last.
    ivec2 tile = min(ivec2(place - 0.5), size - 1) / TILE_SIDE;
    TileLevelRecord tiles = tile_levels[first + level];
    return TilePlace(tiles.first_entry + tile.y * tiles.across + tile.x, place - vec2(tile * TILE_SIDE));
}

bool is_resident(uint entry) {
    return entry != 0u && entry != TILE_REQUESTED;
}

// The finest level that is a single tile: the first substitute for missing tiles.
int single_tile_level(int texture_id) {
    TextureRecord record = textures[texture_id];
    LevelRecord finest = levels[record.first_level];
    int side = (max(finest.texel_width, finest.texel_height) + TILE_SIDE - 1) / TILE_SIDE;
    return clamp(side > 1 ? findMSB(side - 1) + 1 : 0, 0, record.levels - 1);
}
