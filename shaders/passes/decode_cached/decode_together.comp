#version 430
// Decodes tiles, with their borders, into their pages of the atlas, half of one in each work group: each code once for all its texels.
#include "generated/layout.glsl"
layout(local_size_x = BIN_GROUP) in;
#include "ntc/decode.glsl"
#include "passes/decode_cached/page.glsl"
#include "passes/decode_cached/squares.glsl"
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

const int HALF_ROWS = TILE_SIDE / 2;

// Writes the number of a slot's code; false: no texel reads one.
bool fill_slot(int slot, Axis across, Axis down, int number, int shift, LevelRecord level, TileRecord tile) {
    ivec2 run = in_rows(number, run_count(across, shift));
    if (run.y >= run_count(down, shift)) return false;
    ivec2 texel = ivec2(run_texel(across, shift, run.x), run_texel(down, shift, run.y));
    if (texel.x > across.size || texel.y > down.size) return false;
    slot_texture[slot] = tile.texture_id;
    slot_level[slot] = textures[tile.texture_id].first_level + tile.level;
    slot_code[slot] = code_number(level, ivec2(texel_read(across, texel.x), texel_read(down, texel.y)) >> shift);
    return true;
}

void store(TileRecord tile, ivec2 texel, vec4 value) {
    ivec2 place = texel - ivec2(tile.tile_x, tile.tile_y) * TILE_SIDE + TILE_BORDER;
    ivec3 at = ivec3(page_corner(tile.page) + place, tile.page / (PAGES_ACROSS * PAGES_ACROSS));
    imageStore(atlas, at, stored_texel(tile, limit_output(value)));
}

void main() {
    int lane = int(gl_LocalInvocationID.x);
    TileRecord tile = tiles[first_tile + min(int(gl_WorkGroupID.x), tile_count - 1)];
    LevelRecord level = levels[textures[tile.texture_id].first_level + tile.level];
    int part = int(gl_WorkGroupID.y);
    ivec2 first = ivec2(tile.tile_x, tile.tile_y) * TILE_SIDE + ivec2(0, part * HALF_ROWS);
    ivec2 borders = ivec2(first.x - 1, first.x + TILE_SIDE);
    Axis across = axis_of(first.x, TILE_SIDE, borders, 2, level.texel_width, tile.wrap_u);
    Axis down = axis_of(first.y, HALF_ROWS, ivec2(first.y + (part == 0 ? -1 : HALF_ROWS)), 1, level.texel_height, tile.wrap_v);
    int shift = block_shift(level);
    int mip = code_mip(level);
    int fine_shift = square_shift(shift);
    int slots = run_count(across, shift) * run_count(down, shift);
    int squares = run_count(across, fine_shift) * run_count(down, fine_shift);
    // Nothing of it is read.
    if (across.first > across.size || down.first > down.size) slots = 0;
    if (lane == 0 && part == 0) tile_entries[tile.entry] = uint(tile.page + 1);
    for (int before = 0; before < slots; before += SLOTS) {
        bool waits = lane < SLOTS && fill_slot(lane, across, down, before + lane, shift, level, tile);
        uint again = 1u;
        // Each round decodes one code at least.
        for (int round = 0; round < SLOTS && again != 0u; ++round) {
            begin_round(lane);
            barrier();
            if (waits && take_room(lane, 0, 0) >= 0) waits = false;
            barrier();
            decode_coefficients(lane);
            barrier();
            for (int number = lane; number < squares; number += TOGETHER) {
                Square own = square_at(across, down, fine_shift, number);
                if (!own.is_read) continue;
                int slot = run_around(down, shift, fine_shift, own.run.y, own.texel.y) * run_count(across, shift) - before;
                slot += run_around(across, shift, fine_shift, own.run.x, own.texel.x);
                if (slot < 0 || slot >= SLOTS || slot_fits[slot] == 0) continue;
                ivec2 within = own.first & ((1 << shift) - 1);
                int square = mip_square(mip) + ((within.y >> 1) << shift >> 1) + (within.x >> 1);
                vec4 values[4];
                decode_square(slot, square, values);
                for (int one = 0; one < 4; ++one) {
                    ivec2 texel;
                    if (is_stored(own, one, texel)) store(tile, texel, values[one]);
                }
            }
            barrier();
            again = waiting;
            barrier();
        }
    }
}
