// Codec `block` for work groups: each code that the group's invocations read is decoded once, for all of them, in shared memory.
// For work groups of TOGETHER invocations. Every invocation of the group must call what has a barrier.
const int TOGETHER = 64;

// Codes at once. Further ones wait for the next round.
const int SLOTS = 32;
const int SLOT_BITS = 5;
const uint NO_CODE = 0xFFFFFFFFu;
const int MOST_FOURS = MOST_COEFFICIENTS / 4;

shared uint slot_code[SLOTS];         // the code's number among all on the GPU
shared int slot_texture[SLOTS];
shared int slot_level[SLOTS];         // a mip that is decoded from the code
shared ivec4 slot_place[SLOTS];       // its first and last word, and the first block of its decoder
shared uvec4 slot_head[SLOTS];
shared uint slot_ends[SLOTS];         // of the coefficients of each component, in fours: a byte each
shared int slot_fours[SLOTS];         // groups of four coefficients
shared int slot_first[SLOTS];         // of its fours in shared memory
shared uint four_slots[MOST_FOURS];
shared vec4 coefficient_values[MOST_FOURS];
shared ivec4 coefficient_rows[MOST_FOURS];    // word of the tables where the row begins

shared int slot_fits[SLOTS];          // 1: it is decoded in this round
shared uint room_asked;               // by all slots: fours in the lower half, texels in the upper half
shared uint room_taken;               // the same of slots that are decoded in this round
shared uint waiting;                  // 1: some are for the next round

// Number of a code among all: no two levels with codes of their own begin within each other's words.
uint code_number(LevelRecord level, ivec2 block) {
    return uint(level.first_cell + block.y * level.width + block.x);
}

Code slot_content(int slot, int mip) {
    Code code;
    ivec4 place = slot_place[slot];
    code.first_word = place.x;
    code.last_word = place.y;
    code.mip = mip;
    code.tables = place.z;
    code.srgb = float(textures[slot_texture[slot]].srgb != 0);
    code.head = slot_head[slot];
    return code;
}

// Finds the code of a slot whose texture, level and number are known.
void find_slot(int slot) {
    LevelRecord level = levels[slot_level[slot]];
    Code code = numbered_code(textures[slot_texture[slot]], level, int(slot_code[slot]) - level.first_cell);
    slot_place[slot] = ivec4(code.first_word, code.last_word, code.tables, 0);
    slot_head[slot] = code.head;
    uint ends = table_word(4 * (code.tables + int(code.head.x) + int(code.head.y)));
    slot_ends[slot] = ends;
    slot_fours[slot] = int(ends >> 24);
}

// Begins a round; a barrier must follow.
void begin_round(int lane) {
    if (lane < SLOTS) slot_fits[lane] = 0;
    if (lane == 0) room_asked = room_taken = waiting = 0u;
}

// Finds the code of a slot, and room for it and for `texels` of at most `most_texels`; gives the first of these, or -1 where it has to
// wait for another round. Both are shared out at once, so that slots that fit lie before all others.
int take_room(int slot, int texels, int most_texels) {
    find_slot(slot);
    int fours = slot_fours[slot];
    uint own = uint(fours) | uint(texels) << 16;
    uint first = atomicAdd(room_asked, own);
    uint end = first + own;
    if (int(end & 65535u) > MOST_FOURS || int(end >> 16) > most_texels) {
        atomicOr(waiting, 1u);
        return -1;
    }
    slot_first[slot] = int(first & 65535u);
    slot_fits[slot] = 1;
    atomicMax(room_taken, end);
    for (int four = 0; four < fours; ++four) four_slots[slot_first[slot] + four] = uint(slot);
    return int(first >> 16);
}

// Writes the coefficients of all slots that fit to shared memory.
void decode_coefficients(int lane) {
    int fours = int(room_taken & 65535u);
    for (int number = lane; number < 4 * fours; number += TOGETHER) {
        int slot = int(four_slots[number >> 2]);
        Code code = slot_content(slot, 0);
        int own = number - 4 * slot_first[slot];
        int list = 4 * (code.tables + int(code.head.x));
        uint places = table_word(list + 4 * int(code.head.y) + 1 + (own >> 2));
        int place = int((places >> uint(8 * (own & 3))) & 255u);
        uint entry = table_word(list + place);
        uint branches = code_bits(code, int(code.head.z & 65535u) - 3 + place);
        float value = coefficient_of(entry, branches, code_bits(code, int(entry & 1023u)));
        coefficient_values[number >> 2][number & 3] = entry == 0u ? 0.0 : value;
        coefficient_rows[number >> 2][number & 3] = int(code.head.w >> 2) + 4 * code.tables + int((entry >> 15) & 255u) * ROW_WORDS;
    }
}

// By component of the plane, what the coefficients of a slot show at a texel.
vec4 transformed_texel(int slot, int mip, int texel) {
    int place = texel;
    int bits = 8;
#if CODE_MIPS > 1
    if (mip > 0) {
        int first = MIP_1_WORDS;
#if CODE_MIPS > 2
        first = mip == 1 ? MIP_1_WORDS : (mip == 2 ? MIP_2_WORDS : MIP_3_WORDS);
#endif
        place = first + 2 * texel;
        bits = 16;
    }
#endif
    vec4 sums = vec4(0.0);
    uint ends = slot_ends[slot];
    int four = slot_first[slot];
    int first = four;
    for (int component = 0; component < 4 * network_blocks; ++component) {
        int end = first + int((ends >> uint(8 * component)) & 255u);
        float sum = 0.0;
        for (; four < end; ++four) {
            ivec4 at = coefficient_rows[four] + place;
            ivec4 words = ivec4(table_word(at.x), table_word(at.y), table_word(at.z), table_word(at.w));
            sum += dot(coefficient_values[four], vec4(bitfieldExtract(words, 0, bits)));
        }
        sums += vec4(equal(ivec4(component), ivec4(0, 1, 2, 3))) * sum;
    }
    return sums * uintBitsToFloat(uint(127 - 2 * mip) << 23);
}

vec4 four_bytes(int word) {
    return vec4(word << 24 >> 24, word << 16 >> 24, word << 8 >> 24, word >> 24);
}

// By component of the plane, what the coefficients of a slot show at a texel of mip 0 of the code and at its neighbours on the right,
// below, and on the right below.
void transformed_square(int slot, int texel, out vec4 sums[4]) {
    for (int component = 0; component < 4; ++component) sums[component] = vec4(0.0);
    uint ends = slot_ends[slot];
    int four = slot_first[slot];
    int first = four;
    for (int component = 0; component < 4 * network_blocks; ++component) {
        int end = first + int((ends >> uint(8 * component)) & 255u);
        vec4 sum = vec4(0.0);
        for (; four < end; ++four) {
            ivec4 at = coefficient_rows[four] + texel;
            vec4 values = coefficient_values[four];
            sum += values.x * four_bytes(int(table_word(at.x))) + values.y * four_bytes(int(table_word(at.y)));
            sum += values.z * four_bytes(int(table_word(at.z))) + values.w * four_bytes(int(table_word(at.w)));
        }
        for (int other = 0; other < 4; ++other) sums[other] = other == component ? sum : sums[other];
    }
}

// A texel's value, not limited, for what its transform shows.
vec4 texel_value(int slot, int mip, int texel, vec4 transform) {
    TextureRecord record = textures[slot_texture[slot]];
    Code code = slot_content(slot, mip);
    Sum sum = with_base(code, texel, vec4(1.0, 0.0, 0.0, 0.0), transform);
    return unlimited_value(record, sum);
}

vec4 decoded_texel(int slot, int mip, int texel) {
    return texel_value(slot, mip, texel, transformed_texel(slot, mip, texel));
}
