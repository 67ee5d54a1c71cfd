// Tiles of decoded mips: where a surface finds its own.
#include "common/visibility.glsl"
#include "ntc/albedo.glsl"

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

// The mip levels that a trilinear filter reads, and how much of the second.
struct FilterLevels {
    int lower;
    int upper;
    float share;
};

FilterLevels filter_levels(WantedTexel wanted) {
    float last = float(textures[wanted.texture_id].levels - 1);
    float lod = isnan(wanted.lod) || isinf(wanted.lod) ? 0.0 : clamp(wanted.lod, 0.0, last);
    int lower = int(floor(lod));
    return FilterLevels(lower, min(lower + 1, int(last)), lod - float(lower));
}

vec2 wrapped_place(WantedTexel wanted) {
    return vec2(wrap_coordinate(wanted.uv.x, wanted.wrap.x), wrap_coordinate(wanted.uv.y, wanted.wrap.y));
}

// `first` is the material's first TileLevelRecord, `uv` is wrapped.
TilePlace tile_place(int first, int texture_id, int level, vec2 uv) {
    LevelRecord record = levels[textures[texture_id].first_level + level];
    ivec2 size = ivec2(record.texel_width, record.texel_height);
    vec2 texel = uv * vec2(size);
    ivec2 tile = clamp(ivec2(floor(texel)), ivec2(0), size - 1) / TILE_SIDE;
    TileLevelRecord tiles = tile_levels[first + level];
    return TilePlace(
        tiles.first_entry + tile.y * tiles.across + tile.x,
        texel - vec2(tile * TILE_SIDE) + float(TILE_BORDER)
    );
}

bool is_resident(uint entry) {
    return entry != 0u && entry != TILE_ASKED_FOR;
}

// The finest level that is one tile: what a missing tile is replaced by first.
int single_tile_level(int texture_id) {
    TextureRecord record = textures[texture_id];
    LevelRecord finest = levels[record.first_level];
    int side = (max(finest.texel_width, finest.texel_height) + TILE_SIDE - 1) / TILE_SIDE;
    return clamp(side > 1 ? findMSB(side - 1) + 1 : 0, 0, record.levels - 1);
}
