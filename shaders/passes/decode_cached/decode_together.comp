#version 430
// Decodes tiles, with their borders, into their pages of the atlas, a quarter in each work group: each code once for all its texels.
#include "generated/layout.glsl"
layout(local_size_x = BIN_GROUP) in;
#include "ntc/decode.glsl"
#include "passes/decode_cached/page.glsl"
#include "ntc/block_together.glsl"

layout(std430, binding = BINDING_REQUESTS) readonly buffer Tiles {
    TileRecord tiles[];
};
layout(std430, binding = BINDING_TILE_ENTRIES) writeonly buffer TileEntries {
    uint tile_entries[];
};
layout(rgba8, binding = IMAGE_ATLAS) uniform writeonly image2DArray atlas;
uniform int first_tile;
uniform int tile_count;

const int QUARTER_SIDE = TILE_SIDE / 2;
const int QUARTER_PAGE = QUARTER_SIDE + TILE_BORDER;
const int SIDE_SQUARES = QUARTER_SIDE / 2;

// A quarter of a tile in texels of its mip. Along each axis its blocks come in runs: those inside, that of the border's texel, and that
// of the texel right beyond the texture's edge, where the edge does not lie between two blocks.
struct Quarter {
    ivec2 first;     // texel on the left and top, the border not counted
    ivec2 border;    // column and row of its border
    ivec2 size;      // of the mip
    ivec2 wrap;
    int side;        // of a block
    int shift;       // the same as a power of two
    int inside;      // runs inside
};

bvec2 cuts_block(Quarter quarter) {
    bvec2 begins = greaterThan(quarter.size, quarter.first);
    bvec2 ends = lessThan(quarter.size, quarter.first + QUARTER_SIDE);
    ivec2 rest = quarter.size & (quarter.side - 1);
    return bvec2(begins.x && ends.x && rest.x != 0, begins.y && ends.y && rest.y != 0);
}

ivec2 wrapped_in(Quarter quarter, ivec2 texel) {
    return ivec2(
        wrapped_texel(texel.x, quarter.size.x, quarter.wrap.x), wrapped_texel(texel.y, quarter.size.y, quarter.wrap.y)
    );
}

// First texel of a run along one axis.
int run_texel(int run, int inside, int side, int first, int border, int size) {
    return run < inside ? first + run * side : (run == inside ? border : size);
}

int run_of(int texel, int inside, int shift, int first, int border, bool cuts, int size) {
    if (texel == border) return inside;
    return cuts && texel == size ? inside + 1 : (texel - first) >> shift;
}

// The slot of a texel that is read, before those of earlier rounds are taken off.
int slot_of(Quarter quarter, ivec2 texel) {
    bvec2 cuts = cuts_block(quarter);
    int x = run_of(texel.x, quarter.inside, quarter.shift, quarter.first.x, quarter.border.x, cuts.x, quarter.size.x);
    int y = run_of(texel.y, quarter.inside, quarter.shift, quarter.first.y, quarter.border.y, cuts.y, quarter.size.y);
    return y * (quarter.inside + 2) + x;
}

// Writes the number of a slot's code; false: no texel reads one.
bool fill_slot(int slot, Quarter quarter, int number, LevelRecord level, TileRecord tile) {
    int runs = quarter.inside + 2;
    if (number >= runs * runs) return false;
    ivec2 run = ivec2(number % runs, number / runs);
    ivec2 texel;
    texel.x = run_texel(run.x, quarter.inside, quarter.side, quarter.first.x, quarter.border.x, quarter.size.x);
    texel.y = run_texel(run.y, quarter.inside, quarter.side, quarter.first.y, quarter.border.y, quarter.size.y);
    bvec2 cuts = cuts_block(quarter);
    bvec2 unused = bvec2(run.x == quarter.inside + 1 && !cuts.x, run.y == quarter.inside + 1 && !cuts.y);
    if (any(unused) || any(greaterThan(texel, quarter.size))) return false;
    slot_texture[slot] = tile.texture_id;
    slot_level[slot] = textures[tile.texture_id].first_level + tile.level;
    slot_code[slot] = code_number(level, wrapped_in(quarter, texel) >> quarter.shift);
    return true;
}

void store(TileRecord tile, ivec2 texel, vec4 value) {
    ivec2 place = texel - ivec2(tile.tile_x, tile.tile_y) * TILE_SIDE + TILE_BORDER;
    ivec3 at = ivec3(page_corner(tile.page) + place, tile.page / (PAGES_ACROSS * PAGES_ACROSS));
    imageStore(atlas, at, stored_texel(tile, limit_output(value)));
}

// Texels that are decoded one by one: of mip 0 of a code those along the border and beyond the texture's edge, of other mips all.
int single_texels(Quarter quarter, int mip) {
    if (mip > 0) return QUARTER_PAGE * QUARTER_PAGE;
    bvec2 cuts = cuts_block(quarter);
    return QUARTER_PAGE * (2 + int(cuts.x) + int(cuts.y));
}

ivec2 single_texel(Quarter quarter, int mip, int number) {
    ivec2 texel = min(quarter.first, quarter.border);
    int row = number / QUARTER_PAGE;
    int within = number - row * QUARTER_PAGE;
    if (mip > 0) return texel + ivec2(within, row);
    texel += within;
    bool cuts = cuts_block(quarter).x;
    if (row == 0) texel.x = quarter.border.x;
    if (row == 1) texel.y = quarter.border.y;
    if (row == 2 && cuts) texel.x = quarter.size.x;
    if (row == 3 || (row == 2 && !cuts)) texel.y = quarter.size.y;
    return texel;
}

void main() {
    int lane = int(gl_LocalInvocationID.x);
    TileRecord tile = tiles[first_tile + min(int(gl_WorkGroupID.x), tile_count - 1)];
    int level_number = textures[tile.texture_id].first_level + tile.level;
    LevelRecord level = levels[level_number];
    ivec2 part = ivec2(gl_WorkGroupID.y & 1u, gl_WorkGroupID.y >> 1u);
    Quarter quarter;
    quarter.first = ivec2(tile.tile_x, tile.tile_y) * TILE_SIDE + part * QUARTER_SIDE;
    quarter.border = quarter.first + part * (QUARTER_SIDE + TILE_BORDER) - TILE_BORDER;
    quarter.size = ivec2(level.texel_width, level.texel_height);
    quarter.wrap = ivec2(tile.wrap_u, tile.wrap_v);
    quarter.side = block_side(level);
    quarter.shift = block_shift(level);
    quarter.inside = QUARTER_SIDE >> quarter.shift;
    int mip = code_mip(level);
    int slots = (quarter.inside + 2) * (quarter.inside + 2);
    // Nothing of it is read.
    if (any(greaterThan(quarter.first, quarter.size))) slots = 0;
    if (lane == 0 && gl_WorkGroupID.y == 0u) tile_entries[tile.entry] = uint(tile.page + 1);
    for (int before = 0; before < slots; before += SLOTS) {
        bool waits = lane < SLOTS && fill_slot(lane, quarter, before + lane, level, tile);
        uint again = 1u;
        // Each round decodes one code at least.
        for (int round = 0; round < SLOTS && again != 0u; ++round) {
            begin_round(lane);
            barrier();
            if (waits && take_room(lane, 0, 0) >= 0) waits = false;
            barrier();
            decode_coefficients(lane);
            barrier();
            if (mip == 0) {
                ivec2 texel = quarter.first + 2 * ivec2(lane % SIDE_SQUARES, lane / SIDE_SQUARES);
                bvec2 cuts = cuts_block(quarter);
                bool at_edge = (cuts.x && texel.x == quarter.size.x) || (cuts.y && texel.y == quarter.size.y);
                int slot = slot_of(quarter, texel) - before;
                bool own = !at_edge && all(lessThanEqual(texel, quarter.size)) && slot >= 0 && slot < SLOTS;
                if (own && slot_fits[max(slot, 0)] != 0) {
                    ivec2 within = wrapped_in(quarter, texel) & (quarter.side - 1);
                    int number = (within.y << quarter.shift) + within.x;
                    vec4 sums[4];
                    transformed_square(slot, number, sums);
                    for (int one = 0; one < 4 * network_blocks; ++one) {
                        ivec2 step = ivec2(one & 1, one >> 1);
                        // Texels beyond the texture's edge are others of the texture.
                        bool inside = all(bvec2(step.x == 0 || texel.x + step.x < quarter.size.x, step.y == 0 || texel.y + step.y < quarter.size.y));
                        vec4 transform = vec4(sums[0][one], sums[1][one], sums[2][one], sums[3][one]);
                        vec4 value = texel_value(slot, 0, number + step.y * quarter.side + step.x, transform);
                        if (inside) store(tile, texel + step, value);
                    }
                }
            }
            for (int number = lane; number < single_texels(quarter, mip); number += TOGETHER) {
                ivec2 texel = single_texel(quarter, mip, number);
                if (any(greaterThan(texel, quarter.size))) continue;
                int slot = slot_of(quarter, texel) - before;
                if (slot < 0 || slot >= SLOTS || slot_fits[slot] == 0) continue;
                ivec2 within = wrapped_in(quarter, texel) & (quarter.side - 1);
                store(tile, texel, decoded_texel(slot, mip, (within.y << quarter.shift) + within.x));
            }
            barrier();
            again = waiting;
            barrier();
        }
    }
}
