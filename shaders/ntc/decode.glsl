// The codecs (docs/codec.md): records, latents, and `decode_texture` of the codec that CODEC_BLOCK names (generated/codec.glsl).
#include "generated/layout.glsl"
#include "generated/codec.glsl"
#include "ntc/position.glsl"

layout(std430, binding = BINDING_TEXTURES) readonly buffer Textures {
    TextureRecord textures[];
};
layout(std430, binding = BINDING_LEVELS) readonly buffer Levels {
    LevelRecord levels[];
};
layout(std430, binding = BINDING_LATENTS) readonly buffer Latents {
    uint latent_words[];
};

// 1: what decoders hold is stored in an image, which a software renderer reads several times faster than a buffer.
#ifndef WEIGHTS_IN_IMAGE
#define WEIGHTS_IN_IMAGE 0
#endif

// Codec `grid`: number of 4-neuron blocks of a hidden layer, a uniform so that compilers do not unroll loops over them (see
// viewer/render/resources/network.py). Codec `block`: 1.
uniform int network_blocks;

// The neighbour `part`, at most one beyond the ends, of a side of `parts` cells or texels.
int neighbour(int part, int parts, int mode) {
    return mode == WRAP_REPEAT ? (part + parts) % parts : clamp(part, 0, parts - 1);
}

const uint HALF_A_PART = 0x80000000u;

// Clamped to the mips that are on the GPU; not finite counts as 0.
float present_lod(TextureRecord record, float lod) {
    if (isnan(lod) || isinf(lod)) lod = 0.0;
    return clamp(lod, float(record.finest_level), float(record.levels - 1));
}

// A decoder's output limited to [0, 1], NaN as 0: sums that overflow can give NaN, for which clamp is undefined.
vec4 limit_output(vec4 result) {
    return mix(clamp(result, 0.0, 1.0), vec4(0.0), isnan(result));
}

#if CODEC_BLOCK
#include "ntc/block.glsl"
#else
#include "ntc/grid.glsl"
#endif
