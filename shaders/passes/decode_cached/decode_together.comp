#version 430
// Decodes tiles into their pages of the atlas, borders included. A work group decodes one tile, and each code once for all its texels.
#include "generated/layout.glsl"
layout(local_size_x = BIN_GROUP) in;
#include "ntc/decode.glsl"
#include "passes/decode_cached/page.glsl"
#include "passes/decode_cached/squares.glsl"
// These limits suffice for most tiles of mips with eight texels a side per code. Larger tiles take several rounds.
#define SLOTS 32
#define USUAL_FOURS 320
#define SQUARES_AT_ONCE 2
#include "ntc/block_workgroup.glsl"

layout(std430, binding = BINDING_REQUESTS) readonly buffer Tiles {
    TileRecord tiles[];
};
layout(std430, binding = BINDING_TILE_ENTRIES) writeonly buffer TileEntries {
    uint tile_entries[];
};
layout(rgba8, binding = IMAGE_ATLAS) uniform writeonly image2DArray atlas;
uniform int first_tile;
uniform int tile_count;

// An invocation decodes one unit at a time: eight texels of a code, 4x2 inside the tile or a strip along its border.
const int MOST_UNITS = TILE_SIDE * TILE_SIDE / 8 + TILE_SIDE / 4 + 1;
// Offsets of the second, third and fifth texel of a unit from the first, x and y of each in STEP_BITS bits.
const int STEP_BITS = 3;
const uint WIDE_STEPS = 1u | 1u << (3 * STEP_BITS) | 2u << (4 * STEP_BITS);
const uint ROW_STEPS = 1u | 2u << (2 * STEP_BITS) | 4u << (4 * STEP_BITS);
const uint COLUMN_STEPS = ROW_STEPS << STEP_BITS;
// Codes are sorted by their number of coefficients (in fours), longest first, because neighbouring invocations wait for the longest. Lengths
// from LENGTHS - 1 on count as equal.
const int LENGTHS = 16;

// x: first texel of a slot on its layer; y: end of its texels (16 bits for each coordinate); z: steps; w: word of the first unit.
shared uvec4 slot_part[SLOTS];
shared uint units[MOST_UNITS];                   // the slot in the low 8 bits; above, the slot's word that the unit begins with
shared uint units_before[2 * LENGTHS - 1];       // units of longer codes; unused from LENGTHS on
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
        int unit_count = 0;
        int number = begin + lane;
        if (lane < SLOTS && number < codes) {
            ivec2 run = in_rows(number, across_codes);
            Part part = part_at(across, down, shift, run);
            waits = is_stored(part, part.texel);
            bool in_row = is_border(shift, run.y);
            bool in_column = is_border(shift, run.x) && !in_row;
            unit_count = in_row || in_column ? 1 : 1 << max(2 * shift - 3, 0);
            uint steps = WIDE_STEPS;
            int word = 2 * mip_square(mip);
            // Mips with fewer texels per code have no strips; the first texels of a square are stored there.
            if (shift > 1 && (in_row || in_column)) {
                steps = in_row ? ROW_STEPS : COLUMN_STEPS;
                word = strips_word(mip) + (in_row ? STRIP_WORDS : 0);
            }
            slot_part[lane] = uvec4(packed_place(corner + part.texel), packed_place(corner + part.end), steps, word);
            ivec2 block = part.read >> shift;
            if (waits) fill_slot(lane, code_of(textures[tile.texture_id], level, block));
        }
        uint again = 1u;
        // Each round decodes at least one code.
        for (int round = 0; round < SLOTS && again != 0u; ++round) {
            begin_round(lane);
            if (lane < LENGTHS) units_before[lane] = units_of_length[lane] = 0u;
            barrier();
            int length = 0;
            uint first_unit = 0u;
            bool fits = waits && share_room(lane, unit_count, MOST_UNITS) >= 0;
            if (fits) {
                length = LENGTHS - 1 - min(slot_fours(lane), LENGTHS - 1);
                first_unit = atomicAdd(units_of_length[length], uint(unit_count));
                for (int shorter = 1; shorter < LENGTHS; ++shorter) atomicAdd(units_before[length + shorter], uint(unit_count));
            }
            barrier();
            decode_coefficients(lane);
            if (fits) {
                waits = false;
                first_unit += units_before[length];
                for (int unit = 0; unit < unit_count; ++unit) units[first_unit + uint(unit)] = uint(lane | unit << (8 + 2));
            }
            barrier();
            int count = int(room_taken >> 16);
            for (int number = lane; number < count; number += TOGETHER) {
                int slot = int(units[number] & 255u);
                int word_number = int(units[number] >> 8);
                uvec4 part = slot_part[slot];
                // A word holds two texels; a unit of 4x2 texels has two of each row.
                ivec2 within = ivec2(word_number & (side - 1), word_number >> shift << 1);
                ivec2 second = step_of(part.z, 0);
                ivec2 third = step_of(part.z, 1);
                ivec2 fifth = step_of(part.z, 2);
                ivec3 steps = ivec3((second.y << shift) + second.x, (third.y << shift) + third.x, (fifth.y << shift) + fifth.x);
                vec4 values[4 * SQUARES_AT_ONCE];
                decode_texels(slot, tile.texture_id, mip, int(part.w) + word_number, (within.y << shift) + within.x, steps, values);
                // A separate loop: changing texels while they are stored takes more registers than some GPUs have.
                if (is_changed(tile))
                    for (int one = 0; one < 4 * SQUARES_AT_ONCE; ++one) values[one] = stored_texel(tile, values[one]);
                ivec2 texel = place_of(part.x) + within;
                ivec2 end = place_of(part.y);
                for (int one = 0; one < 4 * SQUARES_AT_ONCE; ++one) {
                    ivec2 place = texel + (one & 1) * second + (one >> 1 & 1) * third + (one >> 2) * fifth;
                    float alpha = PLANE == PLANE_BASE ? 1.0 : values[one].a;
                    // Values are finite; the image's format clamps them to [0, 1].
                    if (all(lessThan(place, end))) imageStore(atlas, ivec3(place, layer), vec4(values[one].rgb, alpha));
                }
            }
            barrier();
            again = waiting;
            barrier();
        }
    }
}
