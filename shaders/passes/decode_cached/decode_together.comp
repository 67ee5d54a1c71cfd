#version 430
// Decodes tiles, with their borders, into their pages of the atlas, one in each work group: each code once for all its texels.
#include "generated/layout.glsl"
layout(local_size_x = BIN_GROUP) in;
#include "ntc/decode.glsl"
#include "passes/decode_cached/page.glsl"
#include "passes/decode_cached/squares.glsl"
// Most tiles of mips of eight texels in each code have no more codes and coefficients.
#define SLOTS 32
#define USUAL_FOURS 320
#define SQUARES_AT_ONCE 2
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

// An invocation decodes a unit at once, eight texels of a code: four by two inside the tile, a strip along its border.
const int MOST_UNITS = TILE_SIDE * TILE_SIDE / 8 + TILE_SIDE / 4 + 1;
// How far the second, third and fifth texel of a unit lie from the first: STEP_BITS for each number.
const int STEP_BITS = 3;
const uint WIDE_STEPS = 1u | 1u << (3 * STEP_BITS) | 2u << (4 * STEP_BITS);
const uint ROW_STEPS = 1u | 2u << (2 * STEP_BITS) | 4u << (4 * STEP_BITS);
const uint COLUMN_STEPS = ROW_STEPS << STEP_BITS;
// Codes are ordered by the fours of their coefficients, most first: invocations side by side wait for the longest. From LENGTHS - 1 on
// they count as equal.
const int LENGTHS = 16;

// First texel of a slot on its layer, and the end of its texels, 16 bits for each number; steps; the word of the first unit.
shared uvec4 slot_part[SLOTS];
shared uint units[MOST_UNITS];                   // the slot, and above 8 bits which word of the slot's the unit begins with
shared uint units_before[2 * LENGTHS - 1];       // units of codes that are longer; of no use from LENGTHS on
shared uint units_of_length[LENGTHS];

uint packed_place(ivec2 place) {
    return uint(place.x | place.y << 16);
}

ivec2 place_of(uint bits) {
    return ivec2(bits & 65535u, bits >> 16);
}

ivec2 step_of(uint steps, int number) {
    const uint mask = (1u << STEP_BITS) - 1u;
    return ivec2(steps >> uint(2 * number * STEP_BITS) & mask, steps >> uint((2 * number + 1) * STEP_BITS) & mask);
}

void main() {
    int lane = int(gl_LocalInvocationID.x);
    TileRecord tile = tiles[first_tile + min(int(gl_WorkGroupID.x), tile_count - 1)];
    int level_number = textures[tile.texture_id].first_level + tile.level;
    LevelRecord level = levels[level_number];
    ivec2 first = ivec2(tile.tile_x, tile.tile_y) * TILE_SIDE;
    ivec2 corner = page_corner(tile.page) - first;
    int layer = tile.page / (PAGES_ACROSS * PAGES_ACROSS);
    Axis across = Axis(first.x, level.texel_width);
    Axis down = Axis(first.y, level.texel_height);
    int mip = code_mip(level);
    int shift = block_shift(level);
    int side = 1 << shift;
    int across_codes = run_count(shift);
    int codes = across_codes * across_codes;
    if (lane == 0) tile_entries[tile.entry] = uint(tile.page + 1);
    for (int begin = 0; begin < codes; begin += SLOTS) {
        bool waits = false;
        int own_units = 0;
        int number = begin + lane;
        if (lane < SLOTS && number < codes) {
            ivec2 run = in_rows(number, across_codes);
            Part part = part_at(across, down, shift, run);
            waits = is_kept(part, part.texel);
            bool in_row = is_border(shift, run.y);
            bool in_column = is_border(shift, run.x) && !in_row;
            own_units = in_row || in_column ? 1 : 1 << max(2 * shift - 3, 0);
            uint steps = WIDE_STEPS;
            int word = 2 * mip_square(mip);
            // Mips of fewer texels have no strips: of a square those at its begin are kept.
            if (shift > 1 && (in_row || in_column)) {
                steps = in_row ? ROW_STEPS : COLUMN_STEPS;
                word = strips_word(mip) + (in_row ? STRIP_WORDS : 0);
            }
            slot_part[lane] = uvec4(packed_place(corner + part.texel), packed_place(corner + part.end), steps, word);
            ivec2 block = part.read >> shift;
            if (waits) fill_slot(lane, code_of(textures[tile.texture_id], level, block));
        }
        uint again = 1u;
        // Each round decodes one code at least.
        for (int round = 0; round < SLOTS && again != 0u; ++round) {
            begin_round(lane);
            if (lane < LENGTHS) units_before[lane] = units_of_length[lane] = 0u;
            barrier();
            int length = 0;
            uint first_unit = 0u;
            bool fits = waits && share_room(lane, own_units, MOST_UNITS) >= 0;
            if (fits) {
                length = LENGTHS - 1 - min(slot_fours(lane), LENGTHS - 1);
                first_unit = atomicAdd(units_of_length[length], uint(own_units));
                for (int shorter = 1; shorter < LENGTHS; ++shorter) atomicAdd(units_before[length + shorter], uint(own_units));
            }
            barrier();
            decode_coefficients(lane);
            if (fits) {
                waits = false;
                first_unit += units_before[length];
                for (int own = 0; own < own_units; ++own) units[first_unit + uint(own)] = uint(lane | own << (8 + 2));
            }
            barrier();
            int count = int(room_taken >> 16);
            for (int number = lane; number < count; number += TOGETHER) {
                int slot = int(units[number] & 255u);
                int own = int(units[number] >> 8);
                uvec4 part = slot_part[slot];
                // A word holds two texels, of four by two texels two of each row.
                ivec2 within = ivec2(own & (side - 1), own >> shift << 1);
                ivec2 second = step_of(part.z, 0);
                ivec2 third = step_of(part.z, 1);
                ivec2 fifth = step_of(part.z, 2);
                ivec3 steps = ivec3((second.y << shift) + second.x, (third.y << shift) + third.x, (fifth.y << shift) + fifth.x);
                vec4 values[4 * SQUARES_AT_ONCE];
                decode_texels(slot, tile.texture_id, mip, int(part.w) + own, (within.y << shift) + within.x, steps, values);
                // Apart from the others: to change all texels while they are stored takes more registers than some GPUs have.
                if (is_changed(tile))
                    for (int one = 0; one < 4 * SQUARES_AT_ONCE; ++one) values[one] = stored_texel(tile, values[one]);
                ivec2 texel = place_of(part.x) + within;
                ivec2 end = place_of(part.y);
                for (int one = 0; one < 4 * SQUARES_AT_ONCE; ++one) {
                    ivec2 place = texel + (one & 1) * second + (one >> 1 & 1) * third + (one >> 2) * fifth;
                    float alpha = PLANE == PLANE_BASE ? 1.0 : values[one].a;
                    // The image limits values, which are finite, to [0, 1].
                    if (all(lessThan(place, end))) imageStore(atlas, ivec3(place, layer), vec4(values[one].rgb, alpha));
                }
            }
            barrier();
            again = waiting;
            barrier();
        }
    }
}
