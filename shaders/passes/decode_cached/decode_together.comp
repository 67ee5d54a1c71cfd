#version 430
// Decodes tiles, with their borders, into their pages of the atlas, one in each work group: each code once for all its texels.
#include "generated/layout.glsl"
layout(local_size_x = BIN_GROUP) in;
#include "ntc/decode.glsl"
#include "passes/decode_cached/page.glsl"
#include "passes/decode_cached/squares.glsl"
// Most tiles have no more codes and coefficients.
#define SLOTS 48
#define USUAL_FOURS 320
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

// A part of the border: columns come first, each with its corners, then rows.
struct Part {
    bool is_read;
    bool is_column;
    bool is_corner;
    ivec2 run;       // a column and a place along it, or a place along a row and the row
    ivec2 texel;     // that it begins with
};

// How many columns or rows the border has.
int borders_of(Axis axis) {
    return holds_edge(axis) ? 3 : 2;
}

// Parts of the border in runs of 2^`shifts` texels along rows and columns: those of columns, and those of rows.
ivec2 part_counts(Axis across, Axis down, ivec2 shifts) {
    int borders = borders_of(down);
    return ivec2(borders_of(across) * ((TILE_SIDE >> shifts.y) + borders), borders * (TILE_SIDE >> shifts.x));
}

Part part_at(Axis across, Axis down, ivec2 shifts, int number) {
    int runs = TILE_SIDE >> shifts.y;
    int columns = part_counts(across, down, shifts).x;
    Part part;
    part.is_column = number < columns;
    part.run = in_rows(part.is_column ? number : number - columns, part.is_column ? borders_of(across) : TILE_SIDE >> shifts.x);
    part.is_corner = part.is_column && part.run.y >= runs;
    int row = part.is_corner ? part.run.y - runs : part.run.y;
    part.texel.x = part.is_column ? border_texel(across, part.run.x) : across.first + (part.run.x << shifts.x);
    part.texel.y = part.is_column && !part.is_corner ? down.first + (row << shifts.y) : border_texel(down, row);
    ivec2 size = ivec2(across.size, down.size);
    part.is_read = all(lessThanEqual(part.texel, size));
    // Where a run goes on along the border, it begins inside the texture.
    if (!part.is_corner) part.is_read = part.is_read && (part.is_column ? part.texel.y < size.y : part.texel.x < size.x);
    return part;
}

void store(TileRecord tile, ivec2 corner, ivec2 texel, vec4 value) {
    ivec3 at = ivec3(corner + texel, tile.page / (PAGES_ACROSS * PAGES_ACROSS));
    // The image limits values, which are finite, to [0, 1].
    imageStore(atlas, at, stored_texel(tile, value));
}

void main() {
    int lane = int(gl_LocalInvocationID.x);
    TileRecord tile = tiles[first_tile + min(int(gl_WorkGroupID.x), tile_count - 1)];
    int level_number = textures[tile.texture_id].first_level + tile.level;
    LevelRecord level = levels[level_number];
    ivec2 first = ivec2(tile.tile_x, tile.tile_y) * TILE_SIDE;
    ivec2 corner = page_corner(tile.page) + TILE_BORDER - first;
    Axis across = axis_of(first.x, level.texel_width, tile.wrap_u);
    Axis down = axis_of(first.y, level.texel_height, tile.wrap_v);
    ivec2 size = ivec2(across.size, down.size);
    int mip = code_mip(level);
    int shift = block_shift(level);
    int side = 1 << shift;
    // Squares of a code.
    int squares_shift = max(2 * shift - 2, 0);
    int inside = (TILE_SIDE >> shift) * (TILE_SIDE >> shift);
    ivec2 border_codes = part_counts(across, down, ivec2(shift));
    int codes = inside + border_codes.x + border_codes.y;
    if (lane == 0) tile_entries[tile.entry] = uint(tile.page + 1);
    for (int begin = 0; begin < codes; begin += SLOTS) {
        bool waits = false;
        int number = begin + lane;
        if (lane < SLOTS && number < codes) {
            ivec2 texel = first + ivec2((number << shift) & (TILE_SIDE - 1), (number >> (TILE_SHIFT - shift)) << shift);
            waits = all(lessThan(texel, size));
            if (number >= inside) {
                Part part = part_at(across, down, ivec2(shift), number - inside);
                texel = part.texel;
                waits = part.is_read;
            }
            slot_texture[lane] = tile.texture_id;
            slot_level[lane] = level_number;
            slot_code[lane] = code_number(level, ivec2(texel_read(across, texel.x), texel_read(down, texel.y)) >> shift);
        }
        uint again = 1u;
        // Each round decodes one code at least.
        for (int round = 0; round < SLOTS && again != 0u; ++round) {
            begin_round(lane);
            barrier();
            if (waits && take_room(lane, 0, 0) >= 0) waits = false;
            barrier();
            decode_coefficients(lane);
            barrier();
            int squares = min(inside - begin, SLOTS) << squares_shift;
            for (int number = lane; number < squares; number += TOGETHER) {
                int slot = number >> squares_shift;
                int own = number & ((1 << squares_shift) - 1);
                int code = begin + slot;
                ivec2 block = ivec2((code << shift) & (TILE_SIDE - 1), (code >> (TILE_SHIFT - shift)) << shift);
                ivec2 within = ivec2((own << 1) & (side - 1), own >> max(shift - 1, 0) << 1);
                ivec2 texel = first + block + within;
                ivec2 limit = min(size, first + block + side);
                if (texel.x >= limit.x || texel.y >= limit.y || slot_fits[slot] == 0) continue;
                vec4 values[4];
                decode_four(slot, tile.texture_id, mip, 2 * (mip_square(mip) + own), (within.y << shift) + within.x, ivec2(1, side), values);
                for (int one = 0; one < 4; ++one) {
                    ivec2 place = texel + ivec2(one & 1, one >> 1);
                    if (place.x < limit.x && place.y < limit.y) store(tile, corner, place, values[one]);
                }
            }
            // Along the border, a square or four texels of a column.
            int run_shift = square_shift(shift);
            bool has_columns = shift > 1;
            ivec2 part_shifts = ivec2(run_shift, has_columns ? 2 : run_shift);
            ivec2 parts = part_counts(across, down, part_shifts);
            int around = begin + SLOTS > inside ? parts.x + parts.y : 0;
            for (int number = lane; number < around; number += TOGETHER) {
                Part part = part_at(across, down, part_shifts, number);
                int row = part.is_corner ? part.run.y - (TILE_SIDE >> part_shifts.y) + (TILE_SIDE >> shift)
                                         : part.run.y >> (shift - part_shifts.y);
                int slot = inside - begin + (part.is_column ? row * borders_of(across) + part.run.x
                    : part_counts(across, down, ivec2(shift)).x + (part.run.y << (TILE_SHIFT - shift)) + (part.run.x >> (shift - part_shifts.x)));
                if (!part.is_read || slot < 0 || slot >= SLOTS || slot_fits[slot] == 0) continue;
                ivec2 within = ivec2(texel_read(across, part.texel.x), texel_read(down, part.texel.y)) & (side - 1);
                bool is_strip = part.is_column && has_columns;
                // Of its texels, the one that the part begins with, and whether the others along each axis belong to it.
                ivec2 own = is_strip ? ivec2(0, within.y & 3) : within & run_shift;
                bvec2 more = bvec2(!part.is_column, part.is_column && !part.is_corner);
                ivec2 begins = within - own;
                int word = is_strip ? column_word(mip, begins) : square_word(mip, begins);
                vec4 values[4];
                ivec2 steps = is_strip ? ivec2(side, 2 * side) : ivec2(1, side);
                decode_four(slot, tile.texture_id, mip, word, (begins.y << shift) + begins.x, steps, values);
                for (int one = 0; one < (shift > 0 ? 4 : 1); ++one) {
                    ivec2 place = is_strip ? ivec2(0, one) : ivec2(one & 1, one >> 1);
                    ivec2 texel = part.texel + place - own;
                    bvec2 is_own = equal(place, own);
                    bvec2 is_other = lessThan(texel, size);
                    if ((is_own.x || more.x && is_other.x) && (is_own.y || more.y && is_other.y))
                        store(tile, corner, texel, values[one]);
                }
            }
            barrier();
            again = waiting;
            barrier();
        }
    }
}
