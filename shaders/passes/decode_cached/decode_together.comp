#version 430
// Decodes tiles, with their borders, into their pages of the atlas, half of one in each work group: each code once for all its texels.
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

const int HALF_ROWS = TILE_SIDE / 2;

// Half of a tile along one axis, in texels of its mip. What is read there comes in runs: of blocks or of squares of texels inside, then
// one for each texel of the border, then one for the texel right beyond the texture's edge, where the edge cuts a run.
struct Axis {
    int first;       // texel, the border not counted
    int texels;
    ivec2 border;    // its texels
    int borders;     // how many
    int size;        // of the mip
    ivec2 beside;    // texels that are read before the first one, and beyond the last one
};

Axis axis_of(int first, int texels, ivec2 border, int borders, int size, int wrap) {
    return Axis(first, texels, border, borders, size, ivec2(from_first(-1, size, wrap), to_last(size, size, wrap)));
}

bool cuts_run(Axis axis, int shift) {
    return axis.size > axis.first && axis.size < axis.first + axis.texels && (axis.size & ((1 << shift) - 1)) != 0;
}

int run_count(Axis axis, int shift) {
    return (axis.texels >> shift) + axis.borders + int(cuts_run(axis, shift));
}

// First texel of a run of 2^`shift` texels.
int run_texel(Axis axis, int shift, int run) {
    int outside = run - (axis.texels >> shift);
    if (outside < 0) return axis.first + (run << shift);
    return outside < axis.borders ? (outside == 0 ? axis.border.x : axis.border.y) : axis.size;
}

// The run of 2^`shift` texels with run `run` of 2^`fine_shift` texels, which begins at `texel`.
int run_around(Axis axis, int shift, int fine_shift, int run, int texel) {
    int outside = run - (axis.texels >> fine_shift);
    if (texel == axis.size && cuts_run(axis, shift)) outside = axis.borders;
    return outside < 0 ? run << fine_shift >> shift : (axis.texels >> shift) + outside;
}

// The texel of the texture that is read at `texel`, at most one beyond its edges.
int texel_read(Axis axis, int texel) {
    return texel < 0 ? axis.beside.x : (texel == axis.size ? axis.beside.y : texel);
}

// `number` of rows of `across` by column and row. Both are small: a division of whole numbers takes long.
ivec2 in_rows(int number, int across) {
    int row = int((float(number) + 0.5) / float(across));
    return ivec2(number - row * across, row);
}

// Squares of one texel where the mip of a code has no more.
int square_shift(int shift) {
    return min(shift, 1);
}

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

// Whether a run of texels that begins inside goes on with a second one.
bool has_second(Axis axis, int shift, int run, int texel) {
    return shift > 0 && run < axis.texels >> shift && texel + 1 < axis.size;
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
    int columns = run_count(across, fine_shift);
    int squares = columns * run_count(down, fine_shift);
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
                ivec2 run = in_rows(number, columns);
                ivec2 texel = ivec2(run_texel(across, fine_shift, run.x), run_texel(down, fine_shift, run.y));
                if (texel.x > across.size || texel.y > down.size) continue;
                int slot = run_around(down, shift, fine_shift, run.y, texel.y) * run_count(across, shift) - before;
                slot += run_around(across, shift, fine_shift, run.x, texel.x);
                if (slot < 0 || slot >= SLOTS || slot_fits[slot] == 0) continue;
                ivec2 read = ivec2(texel_read(across, texel.x), texel_read(down, texel.y)) & ((1 << shift) - 1);
                ivec2 within = read & fine_shift;
                int square = mip_square(mip) + ((read.y >> 1) << shift >> 1) + (read.x >> 1);
                vec4 values[4];
                decode_square(slot, square, values);
                // A texel of the border stands alone: its square's others belong elsewhere.
                bvec2 more = bvec2(has_second(across, fine_shift, run.x, texel.x), has_second(down, fine_shift, run.y, texel.y));
                for (int one = 0; one < 4; ++one) {
                    ivec2 place = ivec2(one & 1, one >> 1);
                    bool reads = (more.x || place.x == within.x) && (more.y || place.y == within.y);
                    if (reads) store(tile, texel - within + place, values[one]);
                }
            }
            barrier();
            again = waiting;
            barrier();
        }
    }
}
