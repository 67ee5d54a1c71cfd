// Codec `block`, format 1: trellis-coded coefficients of a transform that a group shares. Included by ntc/decode.glsl.
// Tables lie as ntc/codec/block_1/gpu.py says, in blocks of four words. Always in single precision.
#if WEIGHTS_IN_IMAGE
layout(rgba32ui, binding = IMAGE_WEIGHTS) uniform readonly uimage2D table_image;
uvec4 table_block(int block) {
    return imageLoad(table_image, ivec2(block & ((1 << WEIGHT_COLUMN_BITS) - 1), block >> WEIGHT_COLUMN_BITS));
}
#else
layout(std430, binding = BINDING_WEIGHTS) readonly buffer Tables {
    uvec4 table_blocks[];
};
uvec4 table_block(int block) {
    return table_blocks[block];
}
#endif

// Texels of a block along one side in a mip.
int block_side(LevelRecord level) {
    return BLOCK_SIDE;
}

// Where the code of a block lies, and which tables it is read with.
struct Code {
    int first_word;
    int last_word;
    int lists;     // of the modes for its size, a list after the other
    int basis;
};

Code code_of(TextureRecord record, LevelRecord level, ivec2 block) {
    int tables = FIRST_TABLE_BLOCK + record.decoder * TABLE_BLOCKS;
    int number = block.y * level.width + block.x;
    Code code;
    code.first_word = level.first_cell;
    code.lists = tables;
    code.basis = tables + LISTS_BLOCKS;
#if CODE_SIZES > 1
    // Two words for each run of blocks: where its first code begins, and its blocks' size classes.
    int entry = level.first_cell + 2 * (number / DIRECTORY_RUN);
    int place = number % DIRECTORY_RUN;
    uint classes = stored_word(entry + 1);
    int size_class = int((classes >> (2 * place)) & 3u);
    uint before = classes & ((1u << (2 * place)) - 1u);
    uint low = before & 0x55555555u;
    uint high = (before >> 1) & 0x55555555u;
    code.first_word += int(stored_word(entry)) + place * CLASS_0_WORDS;
    code.first_word += bitCount(low & ~high) * (CLASS_1_WORDS - CLASS_0_WORDS);
    code.first_word += bitCount(high & ~low) * (CLASS_2_WORDS - CLASS_0_WORDS);
    code.first_word += bitCount(low & high) * (CLASS_3_WORDS - CLASS_0_WORDS);
    int words = size_class < 2
        ? (size_class == 0 ? CLASS_0_WORDS : CLASS_1_WORDS)
        : (size_class == 2 ? CLASS_2_WORDS : CLASS_3_WORDS);
    code.lists += size_class * MODES * LIST_BLOCKS;
#else
    int words = CLASS_0_WORDS;
    code.first_word += number * words;
#endif
    code.last_word = code.first_word + words - 1;
    return code;
}

// How far a code has been read.
struct Reader {
    int word;          // of the code's words, that which `low` holds
    uint low;
    uint high;         // the next word
    uint bit;          // of `low`: the next one to be read
    uint state;        // of the trellis
    int list;
#if ROW_CHANNELS
    uvec4 entries;     // of the last four coefficients
#endif
};

Reader reader_of(Code code) {
    Reader reader;
    reader.word = code.first_word;
    reader.low = stored_word(code.first_word);
    reader.high = stored_word(min(code.first_word + 1, code.last_word));
    reader.bit = MODE_BITS;
    reader.state = 0u;
    reader.list = code.lists + int(reader.low & uint(MODES - 1)) * LIST_BLOCKS;
    return reader;
}

// The coefficient whose index is in the lowest bits of `bits`; they are taken away. `entry`: scale as float32 with the depth in its
// lowest bits; where each row of the basis is of one channel (ROW_CHANNELS), above the depth its component and plane.
float next_coefficient(inout Reader reader, inout uint bits, uint entry) {
    uint depth = entry & 7u;
    uint index = bits & ((1u << depth) - 1u);
    bits >>= depth;
    reader.bit += depth;
    uint branch = index & 1u;
    uint subset = (TRELLIS_SUBSETS >> (4u * reader.state + 2u * branch)) & 3u;
    reader.state = depth == 0u ? reader.state : ((reader.state << 1) & 6u) | branch;
#if ROW_CHANNELS
    // Of another plane: nothing of it is shown.
    if (((entry >> 5) & 3u) != uint(PLANE)) return 0.0;
#endif
    // Depth 0 reads block 0, which is 0.
    vec4 level = uintBitsToFloat(table_block(int(((1u << depth) >> 1) + (index >> 1))));
    float value = (subset < 2u ? (subset == 0u ? level.x : level.y) : (subset == 2u ? level.z : level.w));
    return value * uintBitsToFloat(entry & ~ENTRY_MASK);
}

// The next four coefficients of `code`: number 4 `part` and those after it. Once all bits are read, those that follow are 0.
vec4 next_coefficients(inout Reader reader, Code code, int part) {
    uvec4 entries = table_block(reader.list + part);
#if ROW_CHANNELS
    reader.entries = entries;
#endif
    uint bits = (reader.low >> reader.bit) | ((reader.high << 1) << (31u - reader.bit));
    vec4 values;
    values.x = next_coefficient(reader, bits, entries.x);
    values.y = next_coefficient(reader, bits, entries.y);
    values.z = next_coefficient(reader, bits, entries.z);
    values.w = next_coefficient(reader, bits, entries.w);
    if (reader.bit >= 32u) {
        reader.bit -= 32u;
        ++reader.word;
        reader.low = reader.high;
        reader.high = stored_word(min(reader.word + 1, code.last_word));
    }
    return values;
}

#if ROW_CHANNELS
// Four coefficients, by the component that they add to.
struct Four {
    mat4 columns;    // column k: coefficient k, in its component
    bool any;        // whether one of them is of this plane
};

vec4 in_component(float value, uint entry) {
    uint component = (entry >> 3) & 3u;
    return vec4(equal(uvec4(component), uvec4(0u, 1u, 2u, 3u))) * value;
}

Four next_four(inout Reader reader, Code code, int part) {
    vec4 values = next_coefficients(reader, code, part);
    uvec4 entries = reader.entries;
    Four four;
    four.any = any(equal((entries >> 5) & 3u, uvec4(PLANE)));
    four.columns = mat4(
        in_component(values.x, entries.x), in_component(values.y, entries.y),
        in_component(values.z, entries.z), in_component(values.w, entries.w)
    );
    return four;
}

// `sum` and the products of four coefficients with their bytes of the basis for one texel.
CHANNELS_T add_texel(CHANNELS_T sum, Four four, Code code, int part, int texel) {
    if (!four.any) return sum;
    uvec4 texels = table_block(code.basis + part * (BLOCK_SIDE * BLOCK_SIDE / 4) + (texel >> 2));
    uvec2 pair = (texel & 2) == 0 ? texels.xy : texels.zw;
    int bits = int((texel & 1) == 0 ? pair.x : pair.y);
    return sum + CHANNELS_T(four.columns * vec4(bits << 24 >> 24, bits << 16 >> 24, bits << 8 >> 24, bits >> 24));
}
#else
#define Four vec4
#define next_four next_coefficients

// One texel's row of the basis: a signed byte for each channel.
CHANNELS_T basis_row(uint word) {
    int bits = int(word);
    return CHANNELS_T(BASIS_BYTES(bits));
}

// `sum` and the products of four coefficients with the rows of one texel.
CHANNELS_T add_texel(CHANNELS_T sum, vec4 values, Code code, int part, int texel) {
    uvec4 rows = table_block(code.basis + part * BLOCK_SIDE * BLOCK_SIDE + texel);
    sum += values.x * basis_row(rows.x) + values.y * basis_row(rows.y);
    return sum + (values.z * basis_row(rows.z) + values.w * basis_row(rows.w));
}
#endif

// What the transform gives for four texels of a block, channels that the codec lacks as 0.
struct Texels {
    CHANNELS_T first;
    CHANNELS_T second;
    CHANNELS_T third;
    CHANNELS_T fourth;
};

Texels block_texels(Code code, ivec4 texels) {
    Texels sums = Texels(CHANNELS_T(0.0), CHANNELS_T(0.0), CHANNELS_T(0.0), CHANNELS_T(0.0));
    Reader reader = reader_of(code);
    for (int part = 0; part < LIST_BLOCKS && reader.word <= code.last_word; ++part) {
        Four values = next_four(reader, code, part);
        sums.first = add_texel(sums.first, values, code, part, texels.x);
        sums.second = add_texel(sums.second, values, code, part, texels.y);
        sums.third = add_texel(sums.third, values, code, part, texels.z);
        sums.fourth = add_texel(sums.fourth, values, code, part, texels.w);
    }
    return sums;
}

CHANNELS_T texel_sum(Texels texels, int number) {
    if (number < 2) return number == 0 ? texels.first : texels.second;
    return number == 2 ? texels.third : texels.fourth;
}

// The same for one texel.
CHANNELS_T block_texel(Code code, int texel) {
    CHANNELS_T sum = CHANNELS_T(0.0);
    Reader reader = reader_of(code);
    for (int part = 0; part < LIST_BLOCKS && reader.word <= code.last_word; ++part) {
        sum = add_texel(sum, next_four(reader, code, part), code, part, texel);
    }
    return sum;
}

// A footprint in the blocks that it touches: in one, or part after part.
struct Parts {
    bvec2 together;    // along each axis: both texels lie side by side in one block
    ivec2 count;       // along each axis
};

Parts parts_of(Footprint footprint) {
    bvec2 adjacent = equal(footprint.second, footprint.first + 1);
    bvec2 one_block = equal(footprint.first / BLOCK_SIDE, footprint.second / BLOCK_SIDE);
    Parts parts;
    parts.together = bvec2(adjacent.x && one_block.x, adjacent.y && one_block.y);
    parts.count.x = parts.together.x || footprint.share.x == 0.0 ? 1 : 2;
    parts.count.y = parts.together.y || footprint.share.y == 0.0 ? 1 : 2;
    return parts;
}

// What a part of a footprint adds to the filtered value.
CHANNELS_T part_sum(TextureRecord record, LevelRecord level, Footprint footprint, Parts parts, int part) {
    bvec2 other = bvec2(part % parts.count.x == 1, part / parts.count.x == 1);
    ivec2 texel = ivec2(
        other.x ? footprint.second.x : footprint.first.x,
        other.y ? footprint.second.y : footprint.first.y
    );
    vec2 near = mix(1.0 - footprint.share, footprint.share, other);
    vec2 far = mix(vec2(0.0), footprint.share, parts.together);
    ivec2 block = texel / BLOCK_SIDE;
    ivec2 within = texel - block * BLOCK_SIDE;
    int corner = within.y * BLOCK_SIDE + within.x;
    ivec2 steps = ivec2(parts.together) * ivec2(1, BLOCK_SIDE);
    ivec4 texels = corner + ivec4(0, steps.x, steps.y, steps.x + steps.y);
    Texels sums = block_texels(code_of(record, level, block), texels);
    CHANNELS_T upper = near.x * sums.first + far.x * sums.second;
    CHANNELS_T lower = near.x * sums.third + far.x * sums.fourth;
    return near.y * upper + far.y * lower;
}

// What the transform gives over a footprint: once for each of the at most four blocks that it touches.
CHANNELS_T block_sum(TextureRecord record, LevelRecord level, Footprint footprint) {
    Parts parts = parts_of(footprint);
    CHANNELS_T sum = CHANNELS_T(0.0);
    for (int part = 0; part < parts.count.x * parts.count.y; ++part)
        sum += part_sum(record, level, footprint, parts, part);
    return sum;
}

// The texture's value in [0, 1] for a sum over the transform.
vec4 block_value(TextureRecord record, CHANNELS_T channels) {
    vec4 sum = ALL_CHANNELS(channels);
    const int first = 4 * PLANE_PLACE;
    vec4 value = record.mean[PLANE_PLACE] + record.axes[first] * sum.x + record.axes[first + 1] * sum.y;
    return limit_output(value + record.axes[first + 2] * sum.z + record.axes[first + 3] * sum.w);
}

#if FILTER_STOCHASTIC
// At the centre of a texel of a mip that is there, as `lookup_of` gives it: that texel.
vec4 decode_at(TextureRecord record, uvec2 at, float lod, ivec2 wrap, bool wanted) {
    LevelRecord level = levels[record.first_level + int(lod)];
    ivec2 texel = ivec2(place_along(at.x, level.texel_width).part, place_along(at.y, level.texel_height).part);
    ivec2 block = texel / BLOCK_SIDE;
    ivec2 within = texel - block * BLOCK_SIDE;
    return block_value(record, block_texel(code_of(record, level, block), within.y * BLOCK_SIDE + within.x));
}
#else
// The codec's part of `decode_texture`: `at` is wrapped and in units of 2^-32.
vec4 decode_at(TextureRecord record, uvec2 at, float lod, ivec2 wrap, bool wanted) {
    lod = present_lod(record, lod);
    int lower = int(floor(lod));
    float share = lod - float(lower);
    LevelRecord near = levels[record.first_level + lower];
    LevelRecord far = levels[record.first_level + (share > 0.0 ? lower + 1 : lower)];
    Footprint near_footprint = footprint_at(near, at, wrap);
    Footprint far_footprint = footprint_at(far, at, wrap);
    Parts near_parts = parts_of(near_footprint);
    Parts far_parts = parts_of(far_footprint);
    int near_count = near_parts.count.x * near_parts.count.y;
    int count = near_count + (share > 0.0 ? far_parts.count.x * far_parts.count.y : 0);
    CHANNELS_T sum = CHANNELS_T(0.0);
    // One loop over the parts in both mips: neighbouring pixels that cross a block's edge in different mips do so at once.
    for (int number = 0; number < (wanted ? count : 0); ++number) {
        bool second = number >= near_count;
        LevelRecord level = near;
        Footprint footprint = near_footprint;
        Parts parts = near_parts;
        if (second) {
            level = far;
            footprint = far_footprint;
            parts = far_parts;
        }
        sum += (second ? share : 1.0 - share)
            * part_sum(record, level, footprint, parts, second ? number - near_count : number);
    }
    return block_value(record, sum);
}
#endif
