// Codec `block` for work groups: each code that the group's invocations read is decoded once, for all of them, in shared memory.
// For work groups of TOGETHER invocations, which hold SLOTS codes at once, and USUAL_FOURS times four coefficients, if no code has more.
// Each invocation decodes SQUARES_AT_ONCE times four texels at once.
// Further codes wait for the next round. Every invocation of the group must call what has a barrier.
const int TOGETHER = 64;

const uint NO_CODE = 0xFFFFFFFFu;
const int MOST_FOURS = max(USUAL_FOURS, LARGEST_FOURS);

shared uint slot_code[SLOTS];         // the code's number among all on the GPU
shared int slot_texture[SLOTS];
shared int slot_level[SLOTS];         // a mip that is decoded from the code
shared ivec4 slot_place[SLOTS];       // its first and last word, the first block of its list, and the first word of its rows
shared uvec4 slot_head[SLOTS];
shared uint slot_ends[SLOTS];         // ends of the coefficients of each component, as in the first word of an order
shared int slot_first[SLOTS];         // its first four in shared memory
shared uint four_slots[MOST_FOURS + 1];    // one more: with three numbers below, vectors stay aligned
shared uvec2 coefficients[4 * MOST_FOURS];    // value, and word of the tables where the squares of the row begin

shared int slot_fits[SLOTS];          // 1: it is decoded in this round
shared uint room_asked;               // by all slots: fours in the lower half, squares of texels in the upper half
shared uint room_taken;               // room of the slots that are decoded in this round
shared uint waiting;                  // 1: some slots wait for the next round

// Code of a slot, without the decoder's place and the colour space.
Code slot_content(int slot, int mip) {
    Code code;
    ivec4 place = slot_place[slot];
    code.first_word = place.x;
    code.last_word = place.y;
    code.mip = mip;
    code.srgb = 0.0;
    code.head = slot_head[slot];
    return code;
}

// Store a code in a slot.
void fill_slot(int slot, Code code) {
    int rows = int(code.head.w >> 2) + 4 * code.tables + SQUARES_WORD;
    int list = code.tables + int(code.head.x);
    slot_place[slot] = ivec4(code.first_word, code.last_word, list, rows);
    slot_head[slot] = code.head;
    slot_ends[slot] = table_word(4 * (list + int(code.head.y)));
}

// Locate the code of a slot from its texture, level and number.
void find_slot(int slot) {
    LevelRecord level = levels[slot_level[slot]];
    fill_slot(slot, numbered_code(textures[slot_texture[slot]], level, int(slot_code[slot]) - level.first_cell));
}

int slot_fours(int slot) {
    return int(slot_ends[slot] >> 24) & 127;
}

// Begin a round; a barrier must follow.
void begin_round(int lane) {
    if (lane < SLOTS) slot_fits[lane] = 0;
    if (lane == 0) room_asked = room_taken = waiting = 0u;
}

// Allocate room for the code of a slot, and for `squares` of at most `most_squares`; return the first square, or -1 where the slot must
// wait for another round. One atomic operation allocates both, so that slots that fit lie before all others.
int share_room(int slot, int squares, int most_squares) {
    int fours = slot_fours(slot);
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

// Locate the code of a slot, and allocate room as `share_room` does.
int take_room(int slot, int squares, int most_squares) {
    find_slot(slot);
    return share_room(slot, squares, most_squares);
}

// Write the coefficients of all slots that fit to shared memory: four of a list in each invocation, to their places by component.
void decode_coefficients(int lane) {
    int fours = int(room_taken & 65535u);
    for (int number = lane; number < fours; number += TOGETHER) {
        int slot = int(four_slots[number]);
        Code code = slot_content(slot, 0);
        int first = slot_first[slot];
        int own = number - first;
        int list = slot_place[slot].z;
        int blocks = int(code.head.y);
        // Behind the list there are empty ones that fill up fours.
        uvec4 entries = table_block(own < blocks ? list + own : EMPTY_BLOCK);
        uint places = table_word(4 * (list + blocks) + 1 + own);
        uint branches = code_bits(code, int(code.head.z & 65535u) - 3 + 4 * own);
        uint others = code_bits(code, int(entries.x & 1023u));
        int rows = slot_place[slot].w;
        uint bit = 0u;
        for (int one = 0; one < 4; ++one) {
            uint entry = entries[one];
            float value = coefficient_of(entry, branches >> uint(one), others >> (bit & 31u));
            // The other bits of four coefficients lie one after the other, at most 24.
            bit += ((entry >> 10) & 7u) - 1u;
            int place = 4 * first + int((places >> uint(8 * one)) & 255u);
            coefficients[place] = uvec2(floatBitsToUint(value), rows + int((entry >> 15) & 255u) * ROW_WORDS);
        }
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

// First word of the first column of a mip of four or more texels a side, in the part of a row for work groups. Its first row begins
// STRIP_WORDS further.
int strips_word(int mip) {
    return STRIPS_WORD + (mip == 0 ? 0 : 2 * STRIP_WORDS);
}

vec4 four_halves(int word) {
    return vec4(unpackHalf2x16(table_word(word)), unpackHalf2x16(table_word(word + 1)));
}

// Components of a code that remain to be added: bits at the same places as in the ends of their coefficients.
struct Components {
    uint left;
    int four;    // start of the next component in shared memory
};

// Add the next component to the values of texels whose words begin at `word` of the part of a row for work groups.
void add_component(int slot, int texture_id, int mip, int word, inout Components components, inout vec4 values[4 * SQUARES_AT_ONCE]) {
    int bit = findLSB(components.left);
    int end = slot_first[slot] + (int(slot_ends[slot] >> uint(bit)) & 127);
    vec4 sums[SQUARES_AT_ONCE];
    for (int part = 0; part < SQUARES_AT_ONCE; ++part) sums[part] = vec4(0.0);
    for (int four = components.four; four < end; ++four) {
        for (int one = 0; one < 4; ++one) {
            uvec2 own = coefficients[4 * four + one];
            for (int part = 0; part < SQUARES_AT_ONCE; ++part)
                sums[part] += uintBitsToFloat(own.x) * four_halves(int(own.y) + word + 2 * part);
        }
    }
#if BLOCK_SIDE >> (CODE_MIPS - 1) == 1
    if (BLOCK_SIDE >> mip == 1) sums[0].x += sums[0].y;
#endif
    vec4 axis = textures[texture_id].axes[4 * PLANE_PLACE + (bit >> 3)];
    for (int one = 0; one < 4 * SQUARES_AT_ONCE; ++one) values[one] += axis * sums[one >> 2][one & 3];
    components = Components(components.left & (components.left - 1u), end);
}

// Values, not limited, at 4 * SQUARES_AT_ONCE texels of a slot's code, whose words begin at `word` of the part of a row for work groups.
// Texel number `texel` of the code is the first; bit by bit their numbers add `steps`.
void decode_texels(int slot, int texture_id, int mip, int word, int texel, ivec3 steps, out vec4 values[4 * SQUARES_AT_ONCE]) {
    vec4 mean = textures[texture_id].mean[CODE_MIPS * PLANE_PLACE + mip];
    for (int one = 0; one < 4 * SQUARES_AT_ONCE; ++one) values[one] = mean;
    Components components = Components((slot_ends[slot] >> 7) & 0x01010101u, slot_first[slot]);
    // At least one is marked. Apart from the others: then values begin with it.
    add_component(slot, texture_id, mip, word, components, values);
    while (components.left != 0u) add_component(slot, texture_id, mip, word, components, values);
    Code code = slot_content(slot, mip);
    uint width = code.head.w & 3u;
    if (width != 0u) {
        code.srgb = float(textures[texture_id].srgb != 0);
        int side = BLOCK_SIDE >> mip;
        for (int one = 0; one < 4 * SQUARES_AT_ONCE * network_blocks; ++one) {
            int place = min(texel + (one & 1) * steps.x + (one >> 1 & 1) * steps.y + (one >> 2) * steps.z, side * side - 1);
            Sum sum = with_base(code, place, vec4(1.0, 0.0, 0.0, 0.0), vec4(0.0));
            values[one] += untransformed_value(textures[texture_id], sum) - mean;
        }
    }
}
