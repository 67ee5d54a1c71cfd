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
// Four texels that one invocation decodes: those at `first`, `first + right`, `first + down`, and both steps from it.
struct Quad {
    ivec2 first;    // on the page
    ivec2 right;
    ivec2 down;
};

const int TILE_BLOCK_TEXELS = BLOCK_SIDE * BLOCK_SIDE;
const int SIDE_QUADS = TILE_SIDE / 4;

// Squares of two by two texels inside the border, block after block; rows of four along it; its corners. False: there are no more.
bool own_quad(int number, out Quad quad) {
    quad = Quad(ivec2(0), ivec2(0), ivec2(0));
    if (number < TILE_QUADS) {
        int block = number / (TILE_BLOCK_TEXELS / 4);
        int within = number - block * (TILE_BLOCK_TEXELS / 4);
        ivec2 corner = ivec2(block % (TILE_SIDE / BLOCK_SIDE), block / (TILE_SIDE / BLOCK_SIDE)) * BLOCK_SIDE;
        corner += 2 * ivec2(within % (BLOCK_SIDE / 2), within / (BLOCK_SIDE / 2));
        quad = Quad(corner + TILE_BORDER, ivec2(1, 0), ivec2(0, 1));
        return true;
    }
    int rest = number - TILE_QUADS;
    bool beyond = (rest & 1) != 0;
    if (rest < 4 * SIDE_QUADS) {
        bool upright = (rest & 2) != 0;
        ivec2 along = upright ? ivec2(0, 1) : ivec2(1, 0);
        ivec2 across = ivec2(1) - along;
        quad = Quad(along * (4 * (rest >> 2) + TILE_BORDER) + (beyond ? across * (PAGE_SIDE - 1) : ivec2(0)), along, 2 * along);
        return true;
    }
    rest -= 4 * SIDE_QUADS;
    quad.first = ivec2(rest & 1, rest >> 1) * (PAGE_SIDE - 1);
    return rest < 4;
}

ivec2 place_in(Quad quad, int number) {
    return quad.first + (number & 1) * quad.right + (number >> 1) * quad.down;
}

void main() {
    TileRecord tile = tiles[first_tile + int(gl_WorkGroupID.x)];
    Quad quad;
    if (!own_quad(int(gl_WorkGroupID.y) * BIN_GROUP + int(gl_LocalInvocationID.x), quad)) return;
    TextureRecord record = textures[tile.texture_id];
    LevelRecord level = levels[record.first_level + tile.level];
    ivec2 size = ivec2(level.texel_width, level.texel_height);
    // Texels more than a border beyond the texture are never read.
    ivec2 first = ivec2(tile.tile_x, tile.tile_y) * TILE_SIDE + quad.first - TILE_BORDER;
    if (any(greaterThanEqual(first, size + TILE_BORDER))) return;
    ivec2 texels[4];
    for (int number = 0; number < 4; ++number) texels[number] = texel_of(tile, place_in(quad, number), size);
    if (tile.level < record.finest_level) {
        // The mip is not on the GPU: what the next one shows there.
        LevelRecord finest = levels[record.first_level + record.finest_level];
        for (int number = 0; number < min(4, 4 * network_blocks); ++number) {
            ivec2 texel = texel_of(tile, place_in(quad, number), size);
            uvec2 uv = uvec2(texel_centre(texel.x, size.x), texel_centre(texel.y, size.y));
            Footprint footprint = footprint_at(finest, uv, ivec2(tile.wrap_u, tile.wrap_v));
            store_texel(tile, place_in(quad, number), block_value(record, block_sum(record, finest, footprint)));
        }
        return;
    }
    int side = block_side(level);
    ivec2 block = texels[0] / side;
    bool one_block = block == texels[1] / side && block == texels[2] / side && block == texels[3] / side;
    ivec4 numbers;
    for (int number = 0; number < 4; ++number) {
        ivec2 within = texels[number] % side;
        numbers[number] = within.y * side + within.x;
    }
    if (one_block) {
        Texels sums = block_texels(code_of(record, level, block), numbers);
        store_texel(tile, place_in(quad, 0), block_value(record, sums.first));
        store_texel(tile, place_in(quad, 1), block_value(record, sums.second));
        store_texel(tile, place_in(quad, 2), block_value(record, sums.third));
        store_texel(tile, place_in(quad, 3), block_value(record, sums.fourth));
        return;
    }
    // At the texture's edge.
    for (int number = 0; number < min(4, 4 * network_blocks); ++number) {
        ivec2 texel = texel_of(tile, place_in(quad, number), size);
        ivec2 within = texel % side;
        Code code = code_of(record, level, texel / side);
        vec4 value = block_value(record, block_texel(code, within.y * side + within.x));
        store_texel(tile, place_in(quad, number), value);
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
