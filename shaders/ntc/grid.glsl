// Codec `grid` (docs/reference/codec-grid.md): latents, positional encoding, network. ntc/decode.glsl includes it.
#include "ntc/half.glsl"

#if WEIGHTS_IN_IMAGE
#if PRECISION_FP16
layout(rgba16f, binding = IMAGE_WEIGHTS) uniform readonly image2D weight_image;
#else
layout(rgba32f, binding = IMAGE_WEIGHTS) uniform readonly image2D weight_image;
#endif
WEIGHT_T weight(int block) {
    return WEIGHT_T(imageLoad(weight_image, ivec2(block & ((1 << WEIGHT_COLUMN_BITS) - 1), block >> WEIGHT_COLUMN_BITS)));
}
#else
// A stored block of four weights.
#if PRECISION_FP16
#define STORED_T uvec2
#define AS_WEIGHT(stored) unpacked(stored)
#else
#define STORED_T vec4
#define AS_WEIGHT(stored) (stored)
#endif
layout(std430, binding = BINDING_WEIGHTS) readonly buffer Weights {
    STORED_T weights[];
};
WEIGHT_T weight(int block) {
    return AS_WEIGHT(weights[block]);
}
#endif

#include "generated/network.glsl"

// Stored integers of channels 4 * word to 4 * word + 3 of a cell.
vec4 stored_latents(int cell, int word) {
#if LATENT_BITS == 4
    // Spread to one channel per byte, because GPUs convert bytes to floats in one instruction.
    uint bits = stored_word(cell * CELL_WORDS + (word >> 1));
    uint even = (bits & 0x0F0F0F0Fu) >> ((word & 1) * 16);
    uint odd = ((bits >> 4) & 0x0F0F0F0Fu) >> ((word & 1) * 16);
    return vec4(even & 255u, odd & 255u, (even >> 8) & 255u, (odd >> 8) & 255u);
#else
    uint bits = stored_word(cell * CELL_WORDS + word);
    return vec4(bits & 255u, (bits >> 8) & 255u, (bits >> 16) & 255u, bits >> 24);
#endif
}

float triangle_wave(float turns) {
    return 4.0 * abs(turns - floor(turns) - 0.5) - 1.0;
}

// Adds `share` times the features of one level to `x`; `uv` in units of 2^-32.
void add_level(inout float x[DECODER_INPUTS], TextureRecord record, LevelRecord level, uvec2 uv, ivec2 wrap, float share) {
    Place cell_x = place_along(uv.x, level.width);
    Place cell_y = place_along(uv.y, level.height);
    ivec2 corner = ivec2(cell_x.part, cell_y.part);
    corner -= ivec2(cell_x.within < HALF_A_PART, cell_y.within < HALF_A_PART);
    vec2 f = vec2(as_fraction(cell_x.within - HALF_A_PART), as_fraction(cell_y.within - HALF_A_PART));
    int left = from_first(corner.x, level.width, wrap.x);
    int right = to_last(corner.x + 1, level.width, wrap.x);
    int top = level.first_cell + from_first(corner.y, level.height, wrap.y) * level.width;
    int bottom = level.first_cell + to_last(corner.y + 1, level.height, wrap.y) * level.width;
    for (int word = 0; word < LATENT_WORDS; ++word) {
        vec4 upper = mix(stored_latents(top + left, word), stored_latents(top + right, word), f.x);
        vec4 lower = mix(stored_latents(bottom + left, word), stored_latents(bottom + right, word), f.x);
        vec4 latents = (record.offset[word] + record.scale[word] * mix(upper, lower, f.y)) * share;
        x[word * 4] += latents.x;
        x[word * 4 + 1] += latents.y;
        x[word * 4 + 2] += latents.z;
        x[word * 4 + 3] += latents.w;
    }
    int position = LATENT_CHANNELS;
    for (int axis = 0; axis < 2; ++axis) {
        Place texel = place_along(uv[axis], axis == 0 ? level.texel_width : level.texel_height);
        // Whole periods of the longest wave are dropped: they have no effect, and take bits from the fraction of a texel.
        float turns = float(texel.part & ((1u << POSITIONAL_OCTAVES) - 1u)) + as_fraction(texel.within);
        for (int octave = 0; octave < POSITIONAL_OCTAVES; ++octave) {
            turns *= 0.5;
            x[position] += share * triangle_wave(turns);
            x[position + 1] += share * triangle_wave(turns + 0.25);
            position += 2;
        }
    }
}

// The decoder's inputs for `record` at `lod` and `uv`, which is wrapped and in units of 2^-32. `wrap` holds WRAP_ codes.
void decoder_input(TextureRecord record, uvec2 uv, float lod, ivec2 wrap, out float x[DECODER_INPUTS]) {
    lod = present_lod(record, lod);
    int lower = int(floor(lod));
    int upper = min(lower + 1, record.levels - 1);
    float share = lod - float(lower);
    for (int input_number = 0; input_number < DECODER_INPUTS; ++input_number) x[input_number] = 0.0;
    add_level(x, record, levels[record.first_level + lower], uv, wrap, 1.0 - share);
    add_level(x, record, levels[record.first_level + upper], uv, wrap, share);
#if LOD_INPUTS
    x[DECODER_INPUTS - 1] = lod * LOD_INPUT_SCALE;
#endif
    for (int input_number = 0; input_number < DECODER_INPUTS; ++input_number) x[input_number] = to_half(x[input_number]);
}

// The codec's part of `decode_texture`: `at` is wrapped and in units of 2^-32.
vec4 decode_at(TextureRecord record, uvec2 at, float lod, ivec2 wrap, bool wanted) {
    float x[DECODER_INPUTS];
    decoder_input(record, at, lod, wrap, x);
    return limit_output(run_decoder(record.decoder, record.adapter, x, wanted ? network_blocks : 0));
}
