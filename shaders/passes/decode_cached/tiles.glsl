// Page table of decoded tiles: lookup of the tiles that a surface reads.
//
// It is virtual texturing with decoded texels (Mittring 2008, "Advanced Virtual Texture Topics"). Each tile of 32x32 texels of each mip has
// an entry in `tile_entries`: 0 if it is absent, TILE_REQUESTED, or 1 + the number of its page in the atlas.
// request.comp marks the pages that pixels read, and lists missing tiles. The CPU assigns pages, the longest unused first. invalidate.comp
// clears the entries of evicted tiles, and the decode shaders fill pages and entries. sample.frag filters; a missing tile is replaced by the
// next coarser resident one. docs/explanation/decode-paths.md#cached.
#include "common/visibility.glsl"
#include "common/wrap.glsl"
#include "ntc/plane.glsl"

// First TileLevelRecord of each material's texture in its wrap modes; -1 for none.
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
    int entry;     // index into tile_entries
    vec2 at;       // position in texels from the corner of its page
};

#if GRADIENTS
uniform int anisotropy;   // most probes along the longer side of a footprint
#endif

// Trilinear samples along a pixel's footprint (EXT_texture_filter_anisotropic); one sample if it is about as long as wide.
struct Probes {
    int count;
    vec2 step;     // step of uv between samples
    float lod;     // lod of each sample
};

Probes probes_of(ivec2 pixel, WantedTexel wanted, PlaneRecord plane) {
    Probes probes = Probes(1, vec2(0.0), wanted.lod);
#if GRADIENTS
    // Of the second UV set, only the footprint is known.
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
        // False for NaN too.
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

// Moves `place`, on a side of `size` texels, to a place where a filter reads the same texels but none before the first one. Only with
// `repeat` it may read one beyond the last, which is the first one then.
float filtered_place(float place, float size, int wrap) {
    return wrap == WRAP_REPEAT ? (place < 0.5 ? place + size : place) : clamp(place, 0.5, size - 0.5);
}

// The tile with the first of the four texels that a filter reads. `first` is the material's first TileLevelRecord; `uv` is wrapped.
TilePlace tile_place(int first, WantedTexel wanted, int level, vec2 uv) {
    LevelRecord record = levels[textures[wanted.texture_id].first_level + level];
    ivec2 size = ivec2(record.texel_width, record.texel_height);
    vec2 texels = uv * vec2(size);
    vec2 place = vec2(
        filtered_place(texels.x, float(size.x), wanted.wrap.x),
        filtered_place(texels.y, float(size.y), wanted.wrap.y)
    );
    // Rounding may give the texel beyond the last.
    ivec2 tile = min(ivec2(place - 0.5), size - 1) / TILE_SIDE;
    TileLevelRecord tiles = tile_levels[first + level];
    return TilePlace(tiles.first_entry + tile.y * tiles.across + tile.x, place - vec2(tile * TILE_SIDE));
}

bool is_resident(uint entry) {
    return entry != 0u && entry != TILE_REQUESTED;
}

// The finest level with a single tile, the first substitute for missing tiles.
int single_tile_level(int texture_id) {
    TextureRecord record = textures[texture_id];
    LevelRecord finest = levels[record.first_level];
    int side = (max(finest.texel_width, finest.texel_height) + TILE_SIDE - 1) / TILE_SIDE;
    return clamp(side > 1 ? findMSB(side - 1) + 1 : 0, 0, record.levels - 1);
}
