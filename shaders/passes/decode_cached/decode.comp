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

#if BY_SQUARES
#include "passes/decode_cached/squares.glsl"

// Run along both axes of square `number`: first those inside, in groups of four by four, which lie in few blocks, then those of the border.
ivec2 square_run(int shift, int number) {
    int runs = TILE_SIDE >> shift;
    int outside = number - runs * runs;
    if (outside < 0) {
        ivec2 group = ivec2((number >> 4) & (runs / 4 - 1), (number >> 2) / runs);
        return 4 * group + ivec2(number & 3, (number >> 2) & 3);
    }
    return outside <= runs ? ivec2(runs, outside) : ivec2(outside - runs - 1, runs);
}

void main() {
    TileRecord tile = tiles[first_tile + int(gl_WorkGroupID.x)];
    TextureRecord record = textures[tile.texture_id];
    LevelRecord level = levels[record.first_level + tile.level];
    ivec2 corner = ivec2(tile.tile_x, tile.tile_y) * TILE_SIDE;
    Axis across = Axis(corner.x, level.texel_width);
    Axis down = Axis(corner.y, level.texel_height);
    int side = block_side(level);
    // Squares of one texel where the mip of a code has no more.
    int shift = min(side - 1, 1);
    int squares = run_count(shift) * run_count(shift);
    int own = int(gl_WorkGroupID.y) * BIN_GROUP + int(gl_LocalInvocationID.x);
    // Loops end at their ends: a CPU would run what follows a test at their begin once more than needed.
    if (own < squares) do {
        Part square = part_at(across, down, shift, square_run(shift, own));
        if (is_kept(square, square.texel)) {
            ivec2 block = square.read / side;
            ivec2 within = square.read - block * side;
            int texel = within.y * side + within.x;
            Texels texels = block_texels(code_of(record, level, block), texel + ivec4(0, 1, side, side + 1));
            int number = 0;
            do {
                ivec2 place = square.texel + ivec2(number & 1, number >> 1);
                if (is_kept(square, place)) store_texel(tile, place - corner, block_value(record, texel_sum(texels, number)));
                ++number;
            } while (number < 4 * network_blocks);
        }
        own += int(gl_NumWorkGroups.y) * BIN_GROUP;
    } while (own < squares);
}
#elif SHARES_DECODERS
void main() {
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
