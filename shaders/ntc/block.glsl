// Codec `block`: trellis-coded coefficients of a transform that a group shares. Included by ntc/decode.glsl.
// Tables lie as viewer/render/resources/block_tables.py says, in blocks of four words. Always in single precision.
#include "generated/block.glsl"
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

// The 2 x 2 texels of a bilinear lookup in one mip.
struct Footprint {
    ivec2 first;     // texel on the left and top
    ivec2 second;    // texel on the right and bottom, by the wrap mode
    vec2 share;      // of the second one along u and v
};

// `uv` is wrapped and in units of 2^-32.
Footprint footprint_at(LevelRecord level, uvec2 uv, ivec2 wrap) {
    Place x = place_along(uv.x, level.texel_width);
    Place y = place_along(uv.y, level.texel_height);
    ivec2 corner = ivec2(x.part, y.part) - ivec2(x.within < HALF_A_PART, y.within < HALF_A_PART);
    Footprint footprint;
    footprint.first.x = neighbour(corner.x, level.texel_width, wrap.x);
    footprint.first.y = neighbour(corner.y, level.texel_height, wrap.y);
    footprint.second.x = neighbour(corner.x + 1, level.texel_width, wrap.x);
    footprint.second.y = neighbour(corner.y + 1, level.texel_height, wrap.y);
    footprint.share = vec2(as_fraction(x.within - HALF_A_PART), as_fraction(y.within - HALF_A_PART));
    return footprint;
}

// One texel's row of the basis: a signed byte for each channel.
vec4 basis_row(uint word) {
    int bits = int(word);
    return vec4(ivec4(bits << 24, bits << 16, bits << 8, bits) >> 24);
}

// The sum over the coefficients of block `cell` of coefficient x basis, for texels (0, 0), (1, 0), (0, 1), (1, 1) from `texel` on,
// weighted by `weights`.
vec4 block_texels(int decoder, int cell, int texel, vec4 weights) {
    int first = cell * CELL_WORDS;
    uint low = latent_words[first];
    uint high = CELL_WORDS > 1 ? latent_words[first + 1] : 0u;
    int word = 0;
    int tables = FIRST_TABLE_BLOCK + decoder * TABLE_BLOCKS;
    int entry = tables + int(low & uint(MODES - 1)) * LIST_BLOCKS;
    int basis = tables + MODES * LIST_BLOCKS + texel;
    uint state = 0u;
    vec4 sum = vec4(0.0);
    for (int k = 0; k < LIST_BLOCKS; ++k) {
        // Where the coefficient's basis begins, its depth, its scale, its first bit.
        uvec4 coefficient = table_block(entry + k);
        if (coefficient.y == 0u) break;
        if (int(coefficient.w >> 5) > word) {
            ++word;
            low = high;
            high = word + 1 < CELL_WORDS ? latent_words[first + word + 1] : 0u;
        }
        uint shift = coefficient.w & 31u;
        uint index = ((low >> shift) | ((high << 1) << (31u - shift))) & ((1u << coefficient.y) - 1u);
        uint branch = index & 1u;
        uint subset = (TRELLIS_SUBSETS >> (4u * state + 2u * branch)) & 3u;
        state = ((state << 1) & 6u) | branch;
        vec4 level = uintBitsToFloat(table_block(int((1u << (coefficient.y - 1u)) - 1u + (index >> 1))));
        float value = (subset < 2u ? (subset == 0u ? level.x : level.y) : (subset == 2u ? level.z : level.w));
        vec4 scaled = weights * (value * uintBitsToFloat(coefficient.z));
        uvec4 rows = table_block(basis + int(coefficient.x));
        sum += scaled.x * basis_row(rows.x) + scaled.y * basis_row(rows.y);
        sum += scaled.z * basis_row(rows.z) + scaled.w * basis_row(rows.w);
    }
    return sum;
}

// What the transform gives over a footprint: once for each of the at most four blocks that it touches.
vec4 block_sum(TextureRecord record, LevelRecord level, Footprint footprint) {
    ivec2 first = footprint.first;
    ivec2 second = footprint.second;
    bvec2 adjacent = equal(second, first + 1);
    bvec2 one_block = equal(first / BLOCK_SIDE, second / BLOCK_SIDE);
    // Along each axis: both texels at once where they lie side by side in a block, else one after the other.
    bvec2 together = bvec2(adjacent.x && one_block.x, adjacent.y && one_block.y);
    ivec2 parts = ivec2(together.x || footprint.share.x == 0.0 ? 1 : 2, together.y || footprint.share.y == 0.0 ? 1 : 2);
    vec4 sum = vec4(0.0);
    for (int part = 0; part < parts.x * parts.y; ++part) {
        bvec2 other = bvec2(part % parts.x == 1, part / parts.x == 1);
        ivec2 texel = ivec2(other.x ? second.x : first.x, other.y ? second.y : first.y);
        vec2 near = mix(1.0 - footprint.share, footprint.share, other);
        vec2 far = mix(vec2(0.0), footprint.share, together);
        vec4 weights = vec4(near.x * near.y, far.x * near.y, near.x * far.y, far.x * far.y);
        ivec2 block = texel / BLOCK_SIDE;
        ivec2 within = texel - block * BLOCK_SIDE;
        int cell = level.first_cell + block.y * level.width + block.x;
        sum += block_texels(record.decoder, cell, within.y * BLOCK_SIDE + within.x, weights);
    }
    return sum;
}

// The texture's value in [0, 1] for a sum over the transform.
vec4 block_value(TextureRecord record, vec4 sum) {
    vec4 value = record.mean + record.axes[0] * sum.x + record.axes[1] * sum.y;
    return limit_output(value + record.axes[2] * sum.z + record.axes[3] * sum.w);
}

// Decodes the texture of `record` at `uv` and `lod` into [0, 1], in its colour space.
// Where `wanted` is false nothing is decoded and the result is undefined.
vec4 decode_texture(TextureRecord record, vec2 uv, float lod, ivec2 wrap, bool wanted) {
    uvec2 at = fixed_coordinates(uv, wrap);
    lod = present_lod(record, lod);
    int lower = int(floor(lod));
    float share = lod - float(lower);
    int mips = wanted ? (share > 0.0 ? 2 : 1) : 0;
    vec4 sum = vec4(0.0);
    for (int number = 0; number < mips; ++number) {
        LevelRecord level = levels[record.first_level + lower + number];
        sum += (number == 0 ? 1.0 - share : share) * block_sum(record, level, footprint_at(level, at, wrap));
    }
    return block_value(record, sum);
}
