// Decoding of textures (docs/reference/codecs.md): access to latents, and `decode_texture`. generated/decoder.glsl includes the codec's shader.
#include "ntc/records.glsl"
#include "common/numbers.glsl"
#include "ntc/position.glsl"

// 1: decoders or latents are stored in an image. A software renderer reads it several times faster than a buffer.
#ifndef WEIGHTS_IN_IMAGE
#define WEIGHTS_IN_IMAGE 0
#endif
#ifndef LATENTS_IN_IMAGE
#define LATENTS_IN_IMAGE 0
#endif

#if LATENTS_IN_IMAGE
layout(r32ui, binding = IMAGE_LATENTS) uniform readonly uimage2D latent_image;
uint stored_word(int word) {
    return imageLoad(latent_image, ivec2(word & ((1 << LATENT_COLUMN_BITS) - 1), word >> LATENT_COLUMN_BITS)).x;
}
#else
layout(std430, binding = BINDING_LATENTS) readonly buffer Latents {
    uint latent_words[];
};
uint stored_word(int word) {
    return latent_words[word];
}
#endif

// Length of the codec's loops (`GpuTables.loop_length`): a uniform, so that compilers do not unroll them.
uniform int network_blocks;

// Wraps the number of a cell or texel, `part`, on a side of `parts`. It may be one before the first, or one beyond the last.
int from_first(int part, int parts, int mode) {
    return mode == WRAP_REPEAT && part < 0 ? part + parts : max(part, 0);
}
int to_last(int part, int parts, int mode) {
    return mode == WRAP_REPEAT && part >= parts ? part - parts : min(part, parts - 1);
}

const uint HALF_A_PART = 0x80000000u;

// Weight of the second of two texels of a bilinear lookup at `coordinate` along a side, in units of 2^-32.
uint second_share(uint coordinate, int texels) {
    return place_along(coordinate, texels).within - HALF_A_PART;
}

// The 2 x 2 texels of a bilinear lookup in one mip.
struct Footprint {
    ivec2 first;     // texel on the left and top
    ivec2 second;    // texel on the right and bottom, wrapped
    vec2 share;      // weight of the second texel along u and v
};

// `uv` is wrapped and in units of 2^-32.
Footprint footprint_at(LevelRecord level, uvec2 uv, ivec2 wrap) {
    Place x = place_along(uv.x, level.texel_width);
    Place y = place_along(uv.y, level.texel_height);
    ivec2 corner = ivec2(x.part, y.part) - ivec2(x.within < HALF_A_PART, y.within < HALF_A_PART);
    Footprint footprint;
    footprint.first.x = from_first(corner.x, level.texel_width, wrap.x);
    footprint.first.y = from_first(corner.y, level.texel_height, wrap.y);
    footprint.second.x = to_last(corner.x + 1, level.texel_width, wrap.x);
    footprint.second.y = to_last(corner.y + 1, level.texel_height, wrap.y);
    footprint.share = vec2(as_fraction(second_share(uv.x, level.texel_width)), as_fraction(second_share(uv.y, level.texel_height)));
    return footprint;
}

// Clamps `lod` to the mips that are on the GPU; a value that is not finite counts as 0.
float present_lod(TextureRecord record, float lod) {
    if (!is_finite(lod)) lod = 0.0;
    return clamp(lod, float(record.finest_level), float(record.levels - 1));
}

// Limits a decoder's output to [0, 1]; NaN becomes 0. Sums that overflow can give NaN, for which clamp is undefined.
vec4 limit_output(vec4 result) {
    return mix(clamp(result, 0.0, 1.0), vec4(0.0), are_nan(result));
}

// 1: one texel of a trilinear footprint is decoded, chosen at random (ntc/decode_plane.glsl).
#ifndef FILTER_STOCHASTIC
#define FILTER_STOCHASTIC 0
#endif

// The codec's `decode_at`.
#include "generated/decoder.glsl"

// Decodes the texture of `record` at `uv` and `lod` into [0, 1], in its colour space.
// If `wanted` is false, nothing is decoded and the result is undefined.
vec4 decode_texture(TextureRecord record, vec2 uv, float lod, ivec2 wrap, bool wanted) {
    return decode_at(record, fixed_coordinates(uv, wrap), lod, wrap, wanted);
}
