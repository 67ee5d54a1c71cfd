#version 430
// Decodes the tiles of one decoder, with their borders, into their pages of the atlas: several texels in each invocation.
#include "generated/layout.glsl"
layout(local_size_x = BIN_GROUP) in;
#include "common/work_groups.glsl"
#include "ntc/decode.glsl"
#include "passes/decode_cached/page.glsl"
#include "generated/shared_decoder.glsl"

layout(std430, binding = BINDING_REQUESTS) readonly buffer Tiles {
    TileRecord tiles[];
};
layout(std430, binding = BINDING_TILE_ENTRIES) writeonly buffer TileEntries {
    uint tile_entries[];
};
layout(rgba8, binding = IMAGE_ATLAS) uniform writeonly image2DArray atlas;
uniform int first_tile;
uniform int tile_count;

// Texel number `p` of this invocation: its tile and its place on the page; `inside` says whether there is one.
TileRecord own_tile(int p, out ivec2 place, out bool inside) {
    int texels = tile_count * PAGE_TEXELS;
    int number = int(work_group_number()) * BIN_GROUP * PIXELS + int(gl_LocalInvocationID.x) + p * BIN_GROUP;
    inside = number < texels;
    number = min(number, texels - 1);
    place = place_on_page(number % PAGE_TEXELS);
    return tiles[first_tile + number / PAGE_TEXELS];
}

void store_texel(TileRecord tile, ivec2 place, vec4 value) {
    ivec3 at = ivec3(page_corner(tile.page) + place, tile.page / (PAGES_ACROSS * PAGES_ACROSS));
    imageStore(atlas, at, stored_texel(tile, value));
    if (place == ivec2(0)) tile_entries[tile.entry] = uint(tile.page + 1);
}

#if DECODES_QUADS
#include "passes/decode_cached/squares.glsl"

void main() {
    TileRecord tile = tiles[first_tile + int(gl_WorkGroupID.x)];
    TextureRecord record = textures[tile.texture_id];
    LevelRecord level = levels[record.first_level + tile.level];
    LevelRecord finest = levels[record.first_level + record.finest_level];
    ivec2 wrap = ivec2(tile.wrap_u, tile.wrap_v);
    ivec2 corner = ivec2(tile.tile_x, tile.tile_y) * TILE_SIDE;
    Axis across = axis_of(corner.x, level.texel_width, wrap.x);
    Axis down = axis_of(corner.y, level.texel_height, wrap.y);
    int side = block_side(level);
    int shift = min(side - 1, 1);
    int squares = run_count(across, shift) * run_count(down, shift);
    // The mip is not on the GPU: what the next one shows there.
    bool too_coarse = tile.level < record.finest_level;
    int first = int(gl_WorkGroupID.y) * BIN_GROUP + int(gl_LocalInvocationID.x);
    for (int own = first; own < squares; own += int(gl_NumWorkGroups.y) * BIN_GROUP) {
        Square square = square_at(across, down, shift, own);
        if (!square.is_read) continue;
        for (int number = 0; number < (too_coarse ? 4 : 0); ++number) {
            ivec2 place;
            if (!is_stored(square, number, place)) continue;
            ivec2 read = square.first + ivec2(number & 1, number >> 1);
            uvec2 uv = uvec2(texel_centre(read.x, across.size), texel_centre(read.y, down.size));
            vec4 value = block_value(record, block_sum(record, finest, footprint_at(finest, uv, wrap)));
            store_texel(tile, place - corner + TILE_BORDER, value);
        }
        if (too_coarse) continue;
        ivec2 block = square.first / side;
        ivec2 within = square.first - block * side;
        int texel = within.y * side + within.x;
        Texels texels = block_texels(code_of(record, level, block), texel + ivec4(0, 1, side, side + 1));
        for (int number = 0; number < 4 * network_blocks; ++number) {
            ivec2 place;
            if (is_stored(square, number, place))
                store_texel(tile, place - corner + TILE_BORDER, block_value(record, texel_sum(texels, number)));
        }
    }
}
#elif SHARES_DECODERS
void main() {
    fetch_decoder();
    int adapters[PIXELS];
    float x[PIXELS][DECODER_INPUTS];
    vec4 decoded[PIXELS];
    // As in decode_pixels.glsl: no loops of constant length over pixels, no array with a varying index.
    int count = min(network_blocks * PIXELS, PIXELS);
    for (int p = 0; p < count; ++p) {
        ivec2 place;
        bool inside;
        TileRecord tile = own_tile(p, place, inside);
        TextureRecord record = textures[tile.texture_id];
        ivec2 wrap = ivec2(tile.wrap_u, tile.wrap_v);
        float inputs[DECODER_INPUTS];
        decoder_input(record, decoded_at(tile, place), float(tile.level), wrap, inputs);
        for (int q = 0; q < PIXELS; ++q) {
            adapters[q] = q == p ? record.adapter : adapters[q];
            for (int i = 0; i < DECODER_INPUTS; ++i) x[q][i] = q == p ? inputs[i] : x[q][i];
        }
    }
    run_decoders(adapters, x, network_blocks, decoded);
    for (int p = 0; p < count; ++p) {
        ivec2 place;
        bool inside;
        TileRecord tile = own_tile(p, place, inside);
        if (!inside) continue;
        vec4 value = decoded[0];
        for (int q = 1; q < PIXELS; ++q) value = q == p ? decoded[q] : value;
        store_texel(tile, place, limit_output(value));
    }
}
#else
void main() {
    int count = min(network_blocks * PIXELS, PIXELS);
    for (int p = 0; p < count; ++p) {
        ivec2 place;
        bool inside;
        TileRecord tile = own_tile(p, place, inside);
        if (!inside) continue;
        ivec2 wrap = ivec2(tile.wrap_u, tile.wrap_v);
        TextureRecord record = textures[tile.texture_id];
        store_texel(tile, place, decode_at(record, decoded_at(tile, place), float(tile.level), wrap, true));
    }
}
#endif
