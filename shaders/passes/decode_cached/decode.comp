#version 430
// Decodes the tiles of one decoder into their pages of the atlas, borders included. Each invocation decodes several texels.
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

// Tile of texel number `p` of this invocation, and its place on the page. `inside` is false if there is no such texel.
TileRecord tile_of_texel(int p, out ivec2 place, out bool inside) {
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

// Runs of square `number` along both axes. Inner squares come first, in groups of 4x4, which lie in few blocks; then those of the border.
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
    // Squares have one texel if a code has no more in this mip.
    int shift = min(side - 1, 1);
    int squares = run_count(shift) * run_count(shift);
    int number = int(gl_WorkGroupID.y) * BIN_GROUP + int(gl_LocalInvocationID.x);
    // Loops test at their ends: with a test at the beginning, a CPU would run the body once more.
    if (number < squares) do {
        Part square = part_at(across, down, shift, square_run(shift, number));
        if (is_stored(square, square.texel)) {
            ivec2 block = square.read / side;
            ivec2 within = square.read - block * side;
            int texel = within.y * side + within.x;
            Texels texels = block_texels(code_of(record, level, block), texel + ivec4(0, 1, side, side + 1));
            int part = 0;
            do {
                ivec2 place = square.texel + ivec2(part & 1, part >> 1);
                if (is_stored(square, place)) store_texel(tile, place - corner, block_value(record, texel_sum(texels, part)));
                ++part;
            } while (part < 4 * network_blocks);
        }
        number += int(gl_NumWorkGroups.y) * BIN_GROUP;
    } while (number < squares);
}
#elif SHARES_DECODERS
void main() {
    int adapters[PIXELS];
    float x[PIXELS][DECODER_INPUTS];
    vec4 decoded[PIXELS];
    // As in decode_pixels.glsl, loops have no constant length and arrays no varying index.
    int count = min(network_blocks * PIXELS, PIXELS);
    for (int p = 0; p < count; ++p) {
        ivec2 place;
        bool inside;
        TileRecord tile = tile_of_texel(p, place, inside);
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
        TileRecord tile = tile_of_texel(p, place, inside);
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
        TileRecord tile = tile_of_texel(p, place, inside);
        if (!inside) continue;
        ivec2 wrap = ivec2(tile.wrap_u, tile.wrap_v);
        TextureRecord record = textures[tile.texture_id];
        store_texel(tile, place, decode_at(record, decoded_at(tile, place), float(tile.level), wrap, true));
    }
}
#endif
