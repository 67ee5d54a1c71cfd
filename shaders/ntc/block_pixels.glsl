// Codec `block` for pixels side by side: a hash table holds the codes that they read, and squares of texels are decoded once.
// Where shared memory does not hold all, further rounds decode the rest.
#define SLOT_BITS 5
#define SLOTS (1 << SLOT_BITS)
#define PLANE_FOURS 112
#define PLANES_FOURS 128
#define USUAL_FOURS (ANY_PLANE == 1 ? PLANES_FOURS : PLANE_FOURS)
#define SQUARES_AT_ONCE 1
#include "ntc/block_workgroup.glsl"

#if FILTER_STOCHASTIC
const int MIPS_READ = 1;
const int CORNERS = 1;
#else
const int MIPS_READ = 2;
const int CORNERS = 4;
#endif
const int TAPS = MIPS_READ * CORNERS;
const int MOST_SQUARES = 96;
// A texel of a code: its square in the upper bits, its number in the square in the lower two.
const int TEXEL_BITS = 7;
const int SQUARE_BITS = TEXEL_BITS - 2;
const int SQUARE_MASK = (1 << SQUARE_BITS) - 1;
const int SLOT_MASK = SLOTS - 1;
const int TAP_FOUND = 1 << (SLOT_BITS + TEXEL_BITS);

shared uint slot_squares[SLOTS];          // a bit for each square that is read
shared int slot_square[SLOTS];            // first square of the slot in shared memory; negative: its complement, and not decoded in this round
shared vec4 texel_values[4 * MOST_SQUARES];    // values by texel of a square

// Whether shared memory holds the codes of all pixels: another plane that reads the same texels reuses the slots.
#if ANY_PLANE
bool codes_held = false;
#else
const bool codes_held = false;
#endif
int taps_held = 0;    // a bit for each tap of this invocation whose code is held

// The slot and the texel of each invocation's taps with TAP_FOUND, or 0; slot and number of each square in shared memory.
#if ANY_PLANE
const int TAP_BITS = 16;
shared int tap_places[CORNERS * TOGETHER];    // TAP_BITS for each mip, so that squares have room beside them
shared uint square_codes[MOST_SQUARES];

void keep_tap(int lane, int mip, int corner, int place) {
    int at = corner * TOGETHER + lane;
    tap_places[at] = mip == 0 ? place : tap_places[at] | place << TAP_BITS;
}

int kept_tap(int lane, int mip, int corner) {
    return tap_places[corner * TOGETHER + lane] >> (TAP_BITS * mip);
}

void keep_square(int place, int square) {
    square_codes[place] = uint(square);
}

int kept_square(int place) {
    return int(square_codes[place]);
}
#else
// A square is stored at the place of the value of its first texel.
shared int tap_places[TAPS * TOGETHER];

void keep_tap(int lane, int mip, int corner, int place) {
    tap_places[(CORNERS * mip + corner) * TOGETHER + lane] = place;
}

int kept_tap(int lane, int mip, int corner) {
    return tap_places[(CORNERS * mip + corner) * TOGETHER + lane];
}

void keep_square(int place, int square) {
    texel_values[place].x = uintBitsToFloat(uint(square));
}

int kept_square(int place) {
    return int(floatBitsToUint(texel_values[place].x));
}
#endif

// The slot of a code; -1 where there is none left.
int claimed_slot(uint number) {
    int slot = int((number * 0x9E3779B1u) >> (32 - SLOT_BITS));
    for (int tries = 0; tries < SLOTS * network_blocks; ++tries) {
        uint found = atomicCompSwap(slot_code[slot], NO_CODE, number);
        if (found == NO_CODE || found == number) return slot;
        slot = (slot + 1) & (SLOTS - 1);
    }
    return -1;
}

// Place of a slot's square in shared memory.
int square_place(int slot, int square) {
    return slot_square[slot] + bitCount(slot_squares[slot] & ((1u << uint(square)) - 1u));
}

// The texels that a pixel reads of one mip.
struct MipTexels {
    int level;              // number of the mip among all
    float weight;           // weight of the mip
    Footprint footprint;
};

#if FILTER_STOCHASTIC
MipTexels texels_of(int mip, TextureRecord record, uvec2 at, float lod, ivec2 wrap) {
    int level = record.first_level + int(lod);
    ivec2 texel = ivec2(place_along(at.x, levels[level].texel_width).part, place_along(at.y, levels[level].texel_height).part);
    return MipTexels(level, 1.0, Footprint(texel, texel, vec2(0.0)));
}
#else
// `mip` 0: the finer one, 1: the coarser one.
MipTexels texels_of(int mip, TextureRecord record, uvec2 at, float lod, ivec2 wrap) {
    lod = present_lod(record, lod);
    int lower = int(floor(lod));
    float share = lod - float(lower);
    int level = record.first_level + lower + (mip == 1 && share > 0.0 ? 1 : 0);
    return MipTexels(level, mip == 1 ? share : 1.0 - share, footprint_at(levels[level], at, wrap));
}
#endif

// Weight of texel `corner` of a footprint: the first, then those on its right, below, and on its right below.
float corner_weight(MipTexels mip, int corner) {
    vec2 share = mip.footprint.share;
    float across = (corner & 1) != 0 ? share.x : 1.0 - share.x;
    return mip.weight * across * ((corner & 2) != 0 ? share.y : 1.0 - share.y);
}

// A bit for each corner of weight 0.
int unread_corners(MipTexels mip) {
    if (mip.weight == 0.0) return 15;
    return (mip.footprint.share.x == 0.0 ? 10 : 0) | (mip.footprint.share.y == 0.0 ? 12 : 0);
}

// Contributions of the column and the row of a texel of a block to its number in the code.
ivec2 texel_numbers(ivec2 texel, int shift) {
    return ivec2((texel.x >> 1) << 2 | (texel.x & 1), (texel.y >> 1) << shift << 1 | (texel.y & 1) << 1);
}

// The value of texture `texture_id` at `at` and `lod`, limited to [0, 1], for each invocation of the group. Where `wanted` is false
// nothing is decoded, and the result is undefined. With `codes_held` the arguments must be those of the call before, but for `wanted`,
// which may be false.
vec4 decode_together(int lane, bool wanted, int texture_id, uvec2 at, float lod, ivec2 wrap) {
    TextureRecord record = textures[texture_id];
    vec4 sum = vec4(0.0);
    int left = wanted ? (codes_held ? taps_held : (1 << TAPS) - 1) : 0;
    uint again = 1u;
    // Each round decodes one code at least.
    for (int round = 0; round < TAPS * TOGETHER && again != 0u; ++round) {
        bool finds = !codes_held;
        uint squares_taken = finds ? 0u : room_taken & 0xFFFF0000u;
        begin_round(lane);
        if (lane == 0) room_asked = room_taken = squares_taken;
        if (finds && lane < SLOTS) {
            slot_code[lane] = NO_CODE;
            slot_squares[lane] = 0u;
        }
        barrier();
        // Squares are listed for decoding: where a pixel reads one texel, by the first one that reads a square, else by the code's slot.
        bool lists = false;
        uint before = NO_CODE;
        int slot = -1;
        for (int mip = 0; mip < (finds ? MIPS_READ * network_blocks : 0); ++mip) {
            MipTexels own = texels_of(mip, record, at, lod, wrap);
            LevelRecord level = levels[own.level];
            int shift = block_shift(level);
            left &= ~(unread_corners(own) << (CORNERS * mip));
            ivec2 first = own.footprint.first >> shift;
            ivec2 second = own.footprint.second >> shift;
            first.y = level.first_cell + first.y * level.width;
            second.y = level.first_cell + second.y * level.width;
            ivec2 texel = texel_numbers(own.footprint.first & ((1 << shift) - 1), shift);
            ivec2 other = texel_numbers(own.footprint.second & ((1 << shift) - 1), shift);
            texel.x += 4 * mip_square(code_mip(level));
            other.x += 4 * mip_square(code_mip(level));
            for (int corner = 0; corner < CORNERS * network_blocks; ++corner) {
                int tap = CORNERS * mip + corner;
                bvec2 is_second = bvec2((corner & 1) != 0, (corner & 2) != 0);
                int place = 0;
                if ((left & (1 << tap)) != 0) {
                    uint code = uint((is_second.x ? second.x : first.x) + (is_second.y ? second.y : first.y));
                    if (code != before) {
                        slot = claimed_slot(code);
                        before = code;
                        if (slot >= 0) {
                            slot_texture[slot] = texture_id;
                            slot_level[slot] = own.level;
                        }
                    }
                    if (slot >= 0) {
                        int number = (is_second.x ? other.x : texel.x) + (is_second.y ? other.y : texel.y);
                        uint bit = 1u << uint(number >> 2);
                        lists = (atomicOr(slot_squares[slot], bit) & bit) == 0u;
                        place = TAP_FOUND | slot << TEXEL_BITS | number;
                    }
                }
                keep_tap(lane, mip, corner, place);
            }
        }
        if (finds) taps_held = left;
        barrier();
        if (lane < SLOTS) {
            uint left_squares = slot_squares[lane];
            int place = left_squares != 0u ? take_room(lane, finds ? bitCount(left_squares) : 0, MOST_SQUARES) : -1;
            int held = max(slot_square[lane], ~slot_square[lane]);
            slot_square[lane] = finds ? place : (place < 0 ? ~held : held);
            for (; TAPS > 1 && finds && place >= 0 && left_squares != 0u; left_squares &= left_squares - 1u) {
                keep_square(place, lane << SQUARE_BITS | findLSB(left_squares));
                ++place;
            }
        }
        barrier();
        if (TAPS == 1 && lists) {
            int texel = (kept_tap(lane, 0, 0) & (TAP_FOUND - 1)) >> 2;
            int own_slot = texel >> SQUARE_BITS;
            if (slot_square[own_slot] >= 0) keep_square(square_place(own_slot, texel & SQUARE_MASK), texel);
        }
        decode_coefficients(lane);
        barrier();
        int squares = int(room_taken >> 16);
        for (int place = lane; place < squares; place += TOGETHER) {
            int found = kept_square(place);
            int own_slot = found >> SQUARE_BITS;
#if ANY_PLANE
            if (slot_square[own_slot] < 0) continue;
#endif
            int square = found & SQUARE_MASK;
            int mip = mip_of_square(square);
            int side = BLOCK_SIDE >> mip;
            int own = square - mip_square(mip);
            int row = own / max(side / 2, 1);
            int texel = 2 * row * side + 2 * (own - row * (side / 2));
            vec4 values[4];
            decode_texels(own_slot, slot_texture[own_slot], mip, 2 * square, texel, ivec3(1, side, 0), values);
            for (int one = 0; one < 4; ++one) texel_values[one * MOST_SQUARES + place] = values[one];
        }
        barrier();
        for (int mip = 0; mip < MIPS_READ * network_blocks; ++mip) {
            MipTexels own = texels_of(mip, record, at, lod, wrap);
            for (int corner = 0; corner < CORNERS * network_blocks; ++corner) {
                int tap = CORNERS * mip + corner;
                int place = kept_tap(lane, mip, corner);
                int own_slot = (place >> TEXEL_BITS) & SLOT_MASK;
                if ((place & TAP_FOUND) != 0 && slot_square[own_slot] >= 0) {
                    int square = square_place(own_slot, (place >> 2) & SQUARE_MASK);
                    sum += corner_weight(own, corner) * texel_values[(place & 3) * MOST_SQUARES + square];
                    left &= ~(1 << tap);
                }
            }
        }
        if (left != 0) atomicOr(waiting, 1u);
        barrier();
        again = waiting;
#if ANY_PLANE
        codes_held = round == 0 && again == 0u;
#endif
        barrier();
    }
    return limit_output(sum);
}
