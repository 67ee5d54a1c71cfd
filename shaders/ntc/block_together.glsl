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
shared uint four_slots[MOST_FOURS + 1];    // one more: with three numbers below, vectors stay aligned
shared vec4 coefficient_values[MOST_FOURS];
shared ivec4 coefficient_rows[MOST_FOURS];    // word of the tables where the squares of the row begin

shared int slot_fits[SLOTS];          // 1: it is decoded in this round
shared uint room_asked;               // by all slots: fours in the lower half, squares of texels in the upper half
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

// Finds the code of a slot, and room for it and for `squares` of at most `most_squares`; gives the first of these, or -1 where it has
// to wait for another round. Both are shared out at once, so that slots that fit lie before all others.
int take_room(int slot, int squares, int most_squares) {
    find_slot(slot);
    int fours = slot_fours[slot];
    uint own = uint(fours) | uint(squares) << 16;
    uint first = atomicAdd(room_asked, own);
    uint end = first + own;
    if (int(end & 65535u) > MOST_FOURS || int(end >> 16) > most_squares) {
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
        coefficient_values[number >> 2][number & 3] = value;
        coefficient_rows[number >> 2][number & 3] = int(code.head.w >> 2) + 4 * code.tables + int((entry >> 15) & 255u) * ROW_WORDS + SQUARES_WORD;
    }
}

// Squares of 2x2 texels of a code have numbers: mip after mip, row by row. A mip of one texel has one.
const int MIP_1_SQUARE = BLOCK_SIDE * BLOCK_SIDE / 4;
const int MIP_2_SQUARE = MIP_1_SQUARE + BLOCK_SIDE * BLOCK_SIDE / 16;
const int MIP_3_SQUARE = MIP_2_SQUARE + 1;

int mip_square(int mip) {
    return mip == 0 ? 0 : (mip == 1 ? MIP_1_SQUARE : (mip == 2 ? MIP_2_SQUARE : MIP_3_SQUARE));
}

int mip_of_square(int square) {
    int mip = 0;
#if CODE_MIPS > 1
    mip = int(square >= MIP_1_SQUARE);
#endif
#if CODE_MIPS > 2
    mip += int(square >= MIP_2_SQUARE) + int(square >= MIP_3_SQUARE);
#endif
    return mip;
}

vec4 four_halves(int word) {
    return vec4(unpackHalf2x16(table_word(word)), unpackHalf2x16(table_word(word + 1)));
}

// Values, not limited, of the texels of a square: the first, then those on its right, below, and on its right below.
void decode_square(int slot, int square, out vec4 values[4]) {
    int texture_id = slot_texture[slot];
    int mip = mip_of_square(square);
    Code code = slot_content(slot, mip);
    vec4 mean = textures[texture_id].mean[CODE_MIPS * PLANE_PLACE + mip];
    for (int one = 0; one < 4; ++one) values[one] = mean;
    uint width = code.head.w & 3u;
    if (width != 0u) {
        int side = BLOCK_SIDE >> code.mip;
        int own = square - mip_square(mip);
        int row = own / max(side / 2, 1);
        int texel = 2 * row * side + 2 * (own - row * (side / 2));
        for (int one = 0; one < 4 * network_blocks; ++one) {
            int place = min(texel + (one >> 1) * side + (one & 1), side * side - 1);
            Sum sum = with_base(code, place, vec4(1.0, 0.0, 0.0, 0.0), vec4(0.0));
            values[one] = untransformed_value(textures[texture_id], sum);
        }
    }
    uint ends = slot_ends[slot];
    int four = slot_first[slot];
    int first = four;
    for (int component = 0; component < COMPONENTS * network_blocks; ++component) {
        int end = first + int((ends >> uint(8 * component)) & 255u);
        vec4 sum = vec4(0.0);
        for (; four < end; ++four) {
            ivec4 at = coefficient_rows[four] + 2 * square;
            vec4 own = coefficient_values[four];
            sum += own.x * four_halves(at.x);
            sum += own.y * four_halves(at.y);
            sum += own.z * four_halves(at.z);
            sum += own.w * four_halves(at.w);
        }
#if BLOCK_SIDE >> (CODE_MIPS - 1) == 1
        if (BLOCK_SIDE >> mip == 1) sum.x += sum.y;
#endif
        vec4 axis = textures[texture_id].axes[4 * PLANE_PLACE + component];
        values[0] += axis * sum.x;
        values[1] += axis * sum.y;
        values[2] += axis * sum.z;
        values[3] += axis * sum.w;
    }
}
