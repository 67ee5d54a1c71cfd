// Codec `block`: trellis-coded coefficients of a transform that a group shares, and edge parts. Included by ntc/decode.glsl.
// ntc/codec/block/gpu.py documents the layout of the tables, in blocks of four words. Always in single precision.
#if WEIGHTS_IN_IMAGE
layout(rgba32ui, binding = IMAGE_WEIGHTS) uniform readonly uimage2D table_image;
uvec4 table_block(int block) {
    return imageLoad(table_image, ivec2(block & ((1 << WEIGHT_COLUMN_BITS) - 1), block >> WEIGHT_COLUMN_BITS));
}
#elif DECODES_TOGETHER
// The same tables as single words, for work groups.
layout(std430, binding = BINDING_WEIGHTS) readonly buffer Tables {
    uint table_words[];
};
uvec4 table_block(int block) {
    int word = 4 * block;
    return uvec4(table_words[word], table_words[word + 1], table_words[word + 2], table_words[word + 3]);
}
#else
layout(std430, binding = BINDING_WEIGHTS) readonly buffer Tables {
    uvec4 table_blocks[];
};
uvec4 table_block(int block) {
    return table_blocks[block];
}
#endif

#if DECODES_TOGETHER && !WEIGHTS_IN_IMAGE
uint table_word(int word) {
    return table_words[word];
}
#else
uint table_word(int word) {
    uvec4 four = table_block(word >> 2);
    uvec2 pair = (word & 2) == 0 ? four.xy : four.zw;
    return (word & 1) == 0 ? pair.x : pair.y;
}
#endif

// 1: both mips of a footprint are read from a code at once. Software renderers have the registers.
#define MERGES_MIPS (LATENTS_IN_IMAGE && CODE_MIPS > 1 && !FILTER_STOCHASTIC)

// Number of the code's mip that a level is decoded from, limited to 0 to 3 for damaged records.
int code_mip(LevelRecord level) {
    return level.mip_of_cell & 3;
}

// Texels of a block along one side in a mip.
int block_side(LevelRecord level) {
    return BLOCK_SIDE >> code_mip(level);
}

// Base-2 logarithm of that number: texels are divided by shifts.
int block_shift(LevelRecord level) {
    return (BLOCK_SIDE == 8 ? 3 : 2) - code_mip(level);
}

// The block of a texel. Languages of exports have no shifts of vectors.
ivec2 block_of(ivec2 texel, int shift) {
    return ivec2(texel.x >> shift, texel.y >> shift);
}

// Location of a block's code, and the head of the plane that is read from it.
struct Code {
    int first_word;
    int last_word;
    int mip;       // mip of the code
    int tables;    // first block of the decoder
    float srgb;    // 1 where base colours are sRGB-coded, else 0
    uvec4 head;    // head of the code's size, mode and plane
};

// The code of block `number` of a level.
Code numbered_code(TextureRecord record, LevelRecord level, int number) {
    Code code;
    code.tables = record.decoder * TABLE_BLOCKS;
    code.srgb = record.srgb != 0 ? 1.0 : 0.0;
    code.mip = code_mip(level);
    code.first_word = level.first_cell;
    int size_class = 0;
#if CODE_SIZES > 1
    // Two words for each run of blocks: where its first code begins, and its blocks' size classes.
    int entry = level.first_cell + 2 * (number / DIRECTORY_RUN);
    int place = number % DIRECTORY_RUN;
    uint classes = stored_word(entry + 1);
    size_class = int((classes >> (2 * place)) & 3u);
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
#else
    int words = CLASS_0_WORDS;
    code.first_word += number * words;
#endif
    code.last_word = code.first_word + words - 1;
    int mode = int(stored_word(code.first_word) & uint(MODES - 1));
    code.head = table_block(code.tables + (size_class * MODES + mode) * PLANES + PLANE_PLACE);
    return code;
}

Code code_of(TextureRecord record, LevelRecord level, ivec2 block) {
    return numbered_code(record, level, block.y * level.width + block.x);
}

// The 32 bits of a code from bit `at` on.
uint code_bits(Code code, int at) {
    int word = min(code.first_word + (at >> 5), code.last_word);
    uint low = stored_word(word);
    uint high = stored_word(min(word + 1, code.last_word));
    uint shift = uint(at & 31);
    return (low >> shift) | ((high << 1) << (~shift & 31u));
}

float code_byte(Code code, int at) {
    return float(code_bits(code, at) & 255u) * (1.0 / 255.0);
}

// Scale of `entry`.
float scale_of(uint entry) {
#if LATENTS_IN_IMAGE
    // In place of exp2, which takes a CPU twice as long: a polynomial, off by 1e-7 at most.
    uint steps = (entry >> 23) + uint(127 * STEPS_PER_OCTAVE - STEPS_ORIGIN);
    float x = float(steps % uint(STEPS_PER_OCTAVE)) * (1.0 / float(STEPS_PER_OCTAVE));
    float power = 1.0 + x * (0.69315031 + x * (0.24017746 + x * (0.05574993 + x * (0.00909018 + x * 0.00183113))));
    return power * uintBitsToFloat((steps / uint(STEPS_PER_OCTAVE)) << 23);
#else
    float octaves = float(entry >> 23) * (1.0 / float(STEPS_PER_OCTAVE)) - float(STEPS_ORIGIN) / float(STEPS_PER_OCTAVE);
    return exp2(octaves);
#endif
}

// The coefficient of `entry`. The lowest four bits of `branches` end with its branch bit; its other bits are the lowest of `others`.
float coefficient_of(uint entry, uint branches, uint others) {
    uint depth = (entry >> 10) & 7u;
    uint subset = (TRELLIS_SUBSETS >> ((branches << 1) & 31u)) & 3u;
    uint number = 4u * (others & ((1u << ((depth - 1u) & 31u)) - 1u)) + subset;
    float share = float(2u * number + 1u) * uintBitsToFloat((126u - depth) << 23) - 1.0;
    float size = abs(share);
    vec2 curve = depth < DEEP_DEPTH ? SHALLOW_CURVE : DEEP_CURVE;
    float level = share * (1.0 + size * (curve.x + size * curve.y));
    // The last entries of a list are empty.
    return entry == 0u ? 0.0 : level * scale_of(entry);
}

// Four numbers of a row of the basis, of sums over texels in coarser mips: those of a texel and of its neighbours on the right, below,
// and on the right below. Without branches: software renderers go both ways of each.
vec4 row_square(Code code, int mip, uint entry, int texel) {
    int row = int(code.head.w >> 2) + 4 * code.tables + int((entry >> 15) & 255u) * ROW_WORDS;
#if CODE_MIPS > 1
    bool coarse = mip > 0;
    int first = MIP_1_WORDS;
#if CODE_MIPS > 2
    first = mip == 2 ? MIP_2_WORDS : (mip == 3 ? MIP_3_WORDS : first);
#endif
    int at = row + (coarse ? first + 2 * texel : texel);
    uvec4 four = table_block(at >> 2);
    uvec2 pair = (at & 2) == 0 ? four.xy : four.zw;
    int upper = int(coarse || (at & 1) == 0 ? pair.x : pair.y);
    int lower = coarse ? int(pair.y) : upper;
    int end = coarse ? 16 : 24;
    int next = coarse ? 0 : 16;
    return vec4(upper << end >> end, upper << next >> end, lower << (coarse ? 16 : 8) >> end, lower >> end);
#else
    int bits = int(table_word(row + texel));
    return vec4(bits << 24 >> 24, bits << 16 >> 24, bits << 8 >> 24, bits >> 24);
#endif
}

// Weight of one texel of mip 0 of a code in a texel of its mip `mip`.
float texel_share(int mip) {
#if CODE_MIPS > 1
    return uintBitsToFloat(uint(127 - 2 * mip) << 23);
#else
    return 1.0;
#endif
}

// Sums over the parts of a footprint, by component of the plane.
struct Sum {
    vec4 transform;
    vec4 edges;
    vec4 mean_weights;    // weights of the means, by mip of a code
};

vec4 in_component(float value, uint entry) {
    uint component = (entry >> 13) & 3u;
    return mix(vec4(0.0), vec4(value), equal(uvec4(component), uvec4(0u, 1u, 2u, 3u)));
}

// Four coefficients of a list with their entries in the tables.
struct Four {
    uvec4 entries;
    vec4 values;
};

// Number `part` of a code's fours, which are read one after the other. `window`: bits that pass from one call to the next.
Four four_at(Code code, int part, inout uint window) {
    uvec4 entries = table_block(code.tables + int(code.head.x) + part);
    // 32 bits are enough for the states and branches of seven blocks of the list.
    int step = part % 7;
    if (step == 0) window = code_bits(code, int(code.head.z & 65535u) - 3 + 4 * part);
    uint branches = window >> uint(4 * step);
    // The other bits of four coefficients lie one after the other, at most 24.
    uint first = entries.x & 1023u;
    uint others = code_bits(code, int(first));
    vec4 values;
    values.x = coefficient_of(entries.x, branches, others);
    // An empty entry would shift by a negative number, which C++ leaves undefined.
    values.y = coefficient_of(entries.y, branches >> 1, others >> (((entries.y & 1023u) - first) & 31u));
    values.z = coefficient_of(entries.z, branches >> 2, others >> (((entries.z & 1023u) - first) & 31u));
    values.w = coefficient_of(entries.w, branches >> 3, others >> (((entries.w & 1023u) - first) & 31u));
    return Four(entries, values);
}

// A texel of a mip of a code and its neighbours on the right, below, and on the right below, by `weights`; those of weight 0 may lie outside.
struct Reading {
    int texel;
    vec4 weights;
};

float shown_share(Code code, int mip, uint entry, Reading own) {
    return dot(row_square(code, mip, entry, own.texel), own.weights);
}

// Value of the transform in the code's mip. Loops over lists end at their ends: a CPU, which cannot leave them in their middle, would
// run what follows a test at their begin once more than needed.
vec4 transform_square(Code code, Reading own) {
    vec4 sum = vec4(0.0);
    int parts = int(code.head.y);
    own.weights *= texel_share(code.mip);
    uint window = 0u;
    int part = 0;
    if (parts > 0) do {
        Four four = four_at(code, part, window);
        sum += in_component(four.values.x * shown_share(code, code.mip, four.entries.x, own), four.entries.x);
        sum += in_component(four.values.y * shown_share(code, code.mip, four.entries.y, own), four.entries.y);
        sum += in_component(four.values.z * shown_share(code, code.mip, four.entries.z, own), four.entries.z);
        sum += in_component(four.values.w * shown_share(code, code.mip, four.entries.w, own), four.entries.w);
        ++part;
    } while (part < parts);
    return sum;
}

// A texel of an edge part whose indices begin at `first`, between the colours `one` and `one + other`.
vec4 edge_texel(Code code, int first, uint width, int texel, vec4 one, vec4 other) {
    int side = BLOCK_SIDE >> code.mip;
    int count = 1 << code.mip;
    ivec2 corner = ivec2(texel % side, texel / side) * count;
    uint sum = 0u;
    uint squares = 0u;
    int own = 0;
    do {
        int number = (corner.y + (own >> code.mip)) * BLOCK_SIDE + corner.x + (own & (count - 1));
        uint index = code_bits(code, first + int(width) * number) & ((1u << width) - 1u);
        sum += index;
        squares += index * index;
        ++own;
    } while (own < count * count);
    float whole = float(((1u << width) - 1u) << (2 * code.mip));
    float share = float(sum) / whole;
    vec4 value = one + other * share;
    if (code.mip == 0) return value;
    // Colours are averaged by their squares, which is near to linear light: root of mean squared plus variance.
    float deviation = sqrt(float((squares << (2 * code.mip)) - sum * sum)) / whole;
    vec4 spread = other * deviation;
    return mix(value, sqrt(value * value + spread * spread), EDGE_COLOURS(code.srgb));
}

// Value of a code whose transform has the value `transform`: plus the mean, or plus an edge part in its place.
Sum with_base(Code code, int texel, vec4 weights, vec4 transform) {
    Sum sum = Sum(transform, vec4(0.0), vec4(0.0));
    float weight = dot(weights, vec4(1.0));
    uint width = code.head.w & 3u;
    if (width == 0u) {
        sum.mean_weights = vec4(equal(ivec4(code.mip), ivec4(0, 1, 2, 3))) * weight;
        return sum;
    }
    // The difference of the mean between a coarse mip and mip 0 preserves a mask's coverage.
    if (EDGE_MEANS == 1)
        sum.mean_weights = (vec4(equal(ivec4(code.mip), ivec4(0, 1, 2, 3))) - vec4(1.0, 0.0, 0.0, 0.0)) * weight;
    int at = int(code.head.z >> 16);
    vec4 one = EDGE_COLOUR(code, at);
    at += COLOUR_BITS * EDGE_CHANNELS;
    vec4 other = EDGE_COLOUR(code, at) - one;
    at += COLOUR_BITS * EDGE_CHANNELS;
    int side = BLOCK_SIDE >> code.mip;
    int count = weights.z == 0.0 && weights.w == 0.0 ? (weights.y == 0.0 ? 1 : 2) : 4;
    int number = 0;
    do {
        vec2 pair = number < 2 ? weights.xy : weights.zw;
        float own = (number & 1) == 0 ? pair.x : pair.y;
        if (own != 0.0) sum.edges += own * edge_texel(code, at, width, texel + (number >> 1) * side + (number & 1), one, other);
        ++number;
    } while (number < count * network_blocks);
    return sum;
}

Sum block_square(Code code, Reading own) {
    return with_base(code, own.texel, own.weights, transform_square(code, own));
}

Sum block_texel(Code code, int texel) {
    return block_square(code, Reading(texel, vec4(1.0, 0.0, 0.0, 0.0)));
}

Sum added(Sum one, Sum other) {
    return Sum(one.transform + other.transform, one.edges + other.edges, one.mean_weights + other.mean_weights);
}

#if MERGES_MIPS
float shown_shares(Code code, uint entry, Reading near, Reading far) {
    return shown_share(code, code.mip, entry, near) + shown_share(code, code.mip + 1, entry, far);
}

// Values of the transform in the code's mip and in the next one.
vec4 transform_squares(Code code, Reading near, Reading far) {
    vec4 sum = vec4(0.0);
    int parts = int(code.head.y);
    near.weights *= texel_share(code.mip);
    far.weights *= texel_share(code.mip + 1);
    uint window = 0u;
    int part = 0;
    if (parts > 0) do {
        Four four = four_at(code, part, window);
        sum += in_component(four.values.x * shown_shares(code, four.entries.x, near, far), four.entries.x);
        sum += in_component(four.values.y * shown_shares(code, four.entries.y, near, far), four.entries.y);
        sum += in_component(four.values.z * shown_shares(code, four.entries.z, near, far), four.entries.z);
        sum += in_component(four.values.w * shown_shares(code, four.entries.w, near, far), four.entries.w);
        ++part;
    } while (part < parts);
    return sum;
}

// Value of a code in its mip and, if `both`, in the next one: its coefficients are decoded once.
Sum block_squares(Code code, Reading near, Reading far, bool both) {
    // Pixels side by side run the same loop: one for both mips, and another for one, would be run after each other.
    if (!both) far.weights = vec4(0.0);
    Sum sum = Sum(transform_squares(code, near, far), vec4(0.0), vec4(0.0));
    int mips = both ? 2 : 1;
    int number = 0;
    do {
        Reading own = near;
        if (number == 1) own = far;
        sum = added(sum, with_base(code, own.texel, own.weights, vec4(0.0)));
        ++code.mip;
        ++number;
    } while (number < mips);
    return sum;
}
#endif

// Values of the transform at four texels of a block.
struct Texels {
    Code code;
    ivec4 numbers;
    vec4 first;
    vec4 second;
    vec4 third;
    vec4 fourth;
};

// Value of a code at one of four texels.
Sum texel_sum(Texels texels, int number) {
    ivec2 pair = number < 2 ? texels.numbers.xy : texels.numbers.zw;
    vec4 transform = number < 2
        ? (number == 0 ? texels.first : texels.second)
        : (number == 2 ? texels.third : texels.fourth);
    return with_base(texels.code, (number & 1) == 0 ? pair.x : pair.y, vec4(1.0, 0.0, 0.0, 0.0), transform);
}

// Add the contribution of a coefficient at a texel and its neighbours to `sums`: a vector by component for each texel.
void add_texels(inout vec4 sums[4], Code code, uint entry, float value, int texel) {
    vec4 row = row_square(code, code.mip, entry, texel) * texel_share(code.mip);
    vec4 shown = in_component(value, entry);
    sums[0] += shown * row.x;
    sums[1] += shown * row.y;
    sums[2] += shown * row.z;
    sums[3] += shown * row.w;
}

// `texels`: one and its neighbours on the right, below, and on the right below.
Texels block_texels(Code code, ivec4 texels) {
    vec4 sums[4] = vec4[4](vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));
    int parts = int(code.head.y);
    uint window = 0u;
    int part = 0;
    if (parts > 0) do {
        Four four = four_at(code, part, window);
        add_texels(sums, code, four.entries.x, four.values.x, texels.x);
        add_texels(sums, code, four.entries.y, four.values.y, texels.x);
        add_texels(sums, code, four.entries.z, four.values.z, texels.x);
        add_texels(sums, code, four.entries.w, four.values.w, texels.x);
        ++part;
    } while (part < parts);
    return Texels(code, texels, sums[0], sums[1], sums[2], sums[3]);
}

// A footprint in the blocks that it touches: in one, or part after part.
struct Parts {
    bvec2 together;    // along each axis: both texels lie side by side in one block
    ivec2 count;       // along each axis
};

Parts parts_of(LevelRecord level, Footprint footprint) {
    int shift = block_shift(level);
    bvec2 adjacent = equal(footprint.second, footprint.first + 1);
    bvec2 one_block = equal(block_of(footprint.first, shift), block_of(footprint.second, shift));
    Parts parts;
    parts.together = bvec2(adjacent.x && one_block.x, adjacent.y && one_block.y);
    parts.count.x = parts.together.x || footprint.share.x == 0.0 ? 1 : 2;
    parts.count.y = parts.together.y || footprint.share.y == 0.0 ? 1 : 2;
    return parts;
}

// Texels that a footprint reads in the block of a texel: the first one, or `other` along an axis, and its neighbours.
struct BlockReading {
    ivec2 block;
    Reading reading;
};

BlockReading reading_at(LevelRecord level, Footprint footprint, Parts parts, bvec2 other, float share) {
    ivec2 texel = ivec2(
        other.x ? footprint.second.x : footprint.first.x,
        other.y ? footprint.second.y : footprint.first.y
    );
    vec2 near = mix(1.0 - footprint.share, footprint.share, other);
    vec2 far = mix(vec2(0.0), footprint.share, parts.together);
    int shift = block_shift(level);
    ivec2 within = ivec2(texel.x & ((1 << shift) - 1), texel.y & ((1 << shift) - 1));
    vec4 weights = share * vec4(near.x * near.y, far.x * near.y, near.x * far.y, far.x * far.y);
    return BlockReading(block_of(texel, shift), Reading((within.y << shift) + within.x, weights));
}

// Texels of a part of a footprint.
BlockReading part_at(LevelRecord level, Footprint footprint, Parts parts, int part, float share) {
    bvec2 other = bvec2(part % parts.count.x == 1, part / parts.count.x == 1);
    return reading_at(level, footprint, parts, other, share);
}

// The texture's value for a sum over parts, without the transform.
vec4 untransformed_value(TextureRecord record, Sum sum) {
    int mean = CODE_MIPS * PLANE_PLACE;
    vec4 value = sum.edges + record.mean[mean] * sum.mean_weights.x;
#if CODE_MIPS > 1
    value += record.mean[mean + 1] * sum.mean_weights.y;
#endif
#if CODE_MIPS > 2
    value += record.mean[mean + 2] * sum.mean_weights.z + record.mean[mean + 3] * sum.mean_weights.w;
#endif
    return value;
}

// The texture's value for a sum over parts; it may lie outside [0, 1].
vec4 unlimited_value(TextureRecord record, Sum sum) {
    int first = 4 * PLANE_PLACE;
    vec4 value = untransformed_value(record, sum);
    value += record.axes[first] * sum.transform.x + record.axes[first + 1] * sum.transform.y;
    return value + record.axes[first + 2] * sum.transform.z + record.axes[first + 3] * sum.transform.w;
}

vec4 block_value(TextureRecord record, Sum sum) {
    return limit_output(unlimited_value(record, sum));
}

#if MERGES_MIPS
// Whether along an axis the blocks of two texels are among those that a footprint of the next mip reads, each once.
bool reads_same(int first, int second, bool together, int far_first, int far_second, bool two) {
    bool first_read = first == far_first || (two && first == far_second);
    bool second_read = second == far_first || (two && second == far_second);
    return first_read && second_read && (together || first != second) && !(two && far_first == far_second);
}

// Whether each part of `near` lies in a code that `far`, in the next mip, reads in one part.
bool shares_codes(LevelRecord near, Footprint near_footprint, Parts near_parts, LevelRecord far, Footprint far_footprint, Parts far_parts) {
    ivec2 near_first = block_of(near_footprint.first, block_shift(near));
    ivec2 near_second = block_of(near_footprint.second, block_shift(near));
    ivec2 first = block_of(far_footprint.first, block_shift(far));
    ivec2 second = block_of(far_footprint.second, block_shift(far));
    return near.first_cell == far.first_cell
        && reads_same(near_first.x, near_second.x, near_parts.together.x, first.x, second.x, far_parts.count.x == 2)
        && reads_same(near_first.y, near_second.y, near_parts.together.y, first.y, second.y, far_parts.count.y == 2);
}
#endif

#if FILTER_STOCHASTIC
// At the centre of a texel of a mip that is there, as `lookup_of` gives it: that texel.
vec4 decode_at(TextureRecord record, uvec2 at, float lod, ivec2 wrap, bool wanted) {
    LevelRecord level = levels[record.first_level + int(lod)];
    ivec2 texel = ivec2(place_along(at.x, level.texel_width).part, place_along(at.y, level.texel_height).part);
    int shift = block_shift(level);
    ivec2 block = block_of(texel, shift);
    ivec2 within = ivec2(texel.x & ((1 << shift) - 1), texel.y & ((1 << shift) - 1));
    return block_value(record, block_texel(code_of(record, level, block), (within.y << shift) + within.x));
}
#else
// The codec's part of `decode_texture`: `at` is wrapped and in units of 2^-32.
vec4 decode_at(TextureRecord record, uvec2 at, float lod, ivec2 wrap, bool wanted) {
    lod = present_lod(record, lod);
    int lower = int(floor(lod));
    float share = lod - float(lower);
    int next = lower + int(share > 0.0);
    LevelRecord near = levels[record.first_level + lower];
    LevelRecord far = levels[record.first_level + next];
    Footprint near_footprint = footprint_at(near, at, wrap);
    Footprint far_footprint = footprint_at(far, at, wrap);
    Parts near_parts = parts_of(near, near_footprint);
    Parts far_parts = parts_of(far, far_footprint);
    int near_count = near_parts.count.x * near_parts.count.y;
    int count = near_count + (next > lower ? far_parts.count.x * far_parts.count.y : 0);
#if MERGES_MIPS
    bool both = next > lower && shares_codes(near, near_footprint, near_parts, far, far_footprint, far_parts);
    // Then there are no parts in the finer mip alone.
    if (both) {
        count -= near_count;
        near_count = 0;
    }
#endif
    Sum sum = Sum(vec4(0.0), vec4(0.0), vec4(0.0));
    int number = 0;
    // One loop over the parts in both mips: neighbouring pixels that cross a block's edge in different mips do so at once.
    if (wanted) do {
        bool second = number >= near_count;
        int part = second ? number - near_count : number;
        float part_share = second ? share : 1.0 - share;
#if MERGES_MIPS
        LevelRecord level = near;
        Footprint footprint = near_footprint;
        Parts parts = near_parts;
        if (second) {
            level = far;
            footprint = far_footprint;
            parts = far_parts;
        }
        BlockReading own = part_at(level, footprint, parts, part, part_share);
        bvec2 other = notEqual(block_of(near_footprint.first, block_shift(near)), own.block);
        BlockReading finer = reading_at(near, near_footprint, near_parts, other, 1.0 - share);
        Reading reading = own.reading;
        if (both) {
            level = near;
            reading = finer.reading;
            // If no part of the finer mip lies in this block, its weights are 0.
            if (finer.block != own.block) reading.weights = vec4(0.0);
        }
        sum = added(sum, block_squares(code_of(record, level, own.block), reading, own.reading, both));
#else
        // Each part computes its footprint again: keeping both through the loop needs more registers than some GPUs have.
        LevelRecord level = levels[record.first_level + (second ? next : lower)];
        Footprint footprint = footprint_at(level, at, wrap);
        BlockReading own = part_at(level, footprint, parts_of(level, footprint), part, part_share);
        sum = added(sum, block_square(code_of(record, level, own.block), own.reading));
#endif
        ++number;
    } while (number < count);
    return block_value(record, sum);
}
#endif
