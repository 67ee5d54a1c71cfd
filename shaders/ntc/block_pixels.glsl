// Codec `block` for pixels side by side: the codes that they read are found in a hash table, and each texel is decoded once.
// Where shared memory does not hold all, further rounds decode the rest.
#include "ntc/block_together.glsl"

#if FILTER_STOCHASTIC
const int MIPS_READ = 1;
const int CORNERS = 1;
#else
const int MIPS_READ = 2;
const int CORNERS = 4;
#endif
const int TAPS = MIPS_READ * CORNERS;
const int MOST_TEXELS = 256;
const int TEXEL_BITS = 7;
const int TEXEL_MASK = (1 << TEXEL_BITS) - 1;
// Texels of a code: those of its mips one after the other.
const int MIP_1_TEXEL = BLOCK_SIDE * BLOCK_SIDE;
const int MIP_2_TEXEL = MIP_1_TEXEL + MIP_1_TEXEL / 4;
const int MIP_3_TEXEL = MIP_2_TEXEL + MIP_1_TEXEL / 16;
const int MASKS = 3;

shared int tap_places[TAPS * TOGETHER];   // of each invocation's taps: slot and number of the texel; -1: none
shared uint slot_masks[SLOTS * MASKS];    // of texels that are read
shared int slot_texel[SLOTS];             // of its texels among those in shared memory
shared vec4 texel_values[MOST_TEXELS];    // before a texel is decoded: its slot and number

int mip_texel(int mip) {
    return mip == 0 ? 0 : (mip == 1 ? MIP_1_TEXEL : (mip == 2 ? MIP_2_TEXEL : MIP_3_TEXEL));
}

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

// Place of a texel of a slot among those in shared memory.
int texel_place(int slot, int number) {
    uint below = (1u << uint(number & 31)) - 1u;
    int word = number >> 5;
    int before = bitCount(slot_masks[slot * MASKS + word] & below);
    if (word > 0) before += bitCount(slot_masks[slot * MASKS]);
    if (word > 1) before += bitCount(slot_masks[slot * MASKS + 1]);
    return slot_texel[slot] + before;
}

// The texels that a pixel reads of one mip.
struct MipTexels {
    int level;              // number of the mip among all
    float weight;           // of the mip
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

// The value of texture `texture_id` at `at` and `lod`, limited to [0, 1], for each invocation of the group. Where `wanted` is false
// nothing is decoded, and the result is undefined.
vec4 decode_together(int lane, bool wanted, int texture_id, uvec2 at, float lod, ivec2 wrap) {
    TextureRecord record = textures[texture_id];
    vec4 sum = vec4(0.0);
    int left = wanted ? (1 << TAPS) - 1 : 0;
    uint again = 1u;
    // Each round decodes one code at least.
    for (int round = 0; round < TAPS * TOGETHER && again != 0u; ++round) {
        if (lane < SLOTS) {
            slot_code[lane] = NO_CODE;
            for (int word = 0; word < MASKS; ++word) slot_masks[lane * MASKS + word] = 0u;
        }
        begin_round(lane);
        barrier();
        // Of texels that several pixels read, one has to list it.
        int owned = 0;
        uint before = NO_CODE;
        int slot = -1;
        for (int mip = 0; mip < MIPS_READ * network_blocks; ++mip) {
            MipTexels own = texels_of(mip, record, at, lod, wrap);
            LevelRecord level = levels[own.level];
            int shift = block_shift(level);
            int first_texel = mip_texel(code_mip(level));
            for (int corner = 0; corner < CORNERS * network_blocks; ++corner) {
                int tap = CORNERS * mip + corner;
                int place = -1;
                if ((left & (1 << tap)) != 0) {
                    if (corner_weight(own, corner) == 0.0) left &= ~(1 << tap);
                    ivec2 texel = own.footprint.first;
                    if ((corner & 1) != 0) texel.x = own.footprint.second.x;
                    if ((corner & 2) != 0) texel.y = own.footprint.second.y;
                    ivec2 block = texel >> shift;
                    ivec2 within = texel - (block << shift);
                    uint code = code_number(level, block);
                    if ((left & (1 << tap)) != 0 && code != before) {
                        slot = claimed_slot(code);
                        before = code;
                    }
                    if ((left & (1 << tap)) != 0 && slot >= 0) {
                        slot_texture[slot] = texture_id;
                        slot_level[slot] = own.level;
                        int number = first_texel + (within.y << shift) + within.x;
                        uint bit = 1u << uint(number & 31);
                        uint old = atomicOr(slot_masks[slot * MASKS + (number >> 5)], bit);
                        if ((old & bit) == 0u) owned |= 1 << tap;
                        place = slot << TEXEL_BITS | number;
                    }
                }
                tap_places[tap * TOGETHER + lane] = place;
            }
        }
        barrier();
        if (lane < SLOTS && slot_code[lane] != NO_CODE) {
            int texels = 0;
            for (int word = 0; word < MASKS; ++word) texels += bitCount(slot_masks[lane * MASKS + word]);
            slot_texel[lane] = take_room(lane, texels, MOST_TEXELS);
        }
        barrier();
        for (int number = 0; number < TAPS * network_blocks; ++number) {
            int place = tap_places[number * TOGETHER + lane];
            int own = place >> TEXEL_BITS;
            if ((owned & (1 << number)) != 0 && slot_fits[own] != 0)
                texel_values[texel_place(own, place & TEXEL_MASK)].x = uintBitsToFloat(uint(place));
        }
        decode_coefficients(lane);
        barrier();
        int texels = int(room_taken >> 16);
        for (int place = lane; place < texels; place += TOGETHER) {
            int found = int(floatBitsToUint(texel_values[place].x));
            int number = found & TEXEL_MASK;
            int mip = 0;
#if CODE_MIPS > 1
            mip = int(number >= MIP_1_TEXEL);
#endif
#if CODE_MIPS > 2
            mip += int(number >= MIP_2_TEXEL) + int(number >= MIP_3_TEXEL);
#endif
            texel_values[place] = decoded_texel(found >> TEXEL_BITS, mip, number - mip_texel(mip));
        }
        barrier();
        for (int mip = 0; mip < MIPS_READ * network_blocks; ++mip) {
            MipTexels own = texels_of(mip, record, at, lod, wrap);
            for (int corner = 0; corner < CORNERS * network_blocks; ++corner) {
                int tap = CORNERS * mip + corner;
                int place = tap_places[tap * TOGETHER + lane];
                int slot_of_place = max(place >> TEXEL_BITS, 0);
                if (place >= 0 && slot_fits[slot_of_place] != 0) {
                    sum += corner_weight(own, corner) * texel_values[texel_place(slot_of_place, place & TEXEL_MASK)];
                    left &= ~(1 << tap);
                }
            }
        }
        if (left != 0) atomicOr(waiting, 1u);
        barrier();
        again = waiting;
        barrier();
    }
    return limit_output(sum);
}
