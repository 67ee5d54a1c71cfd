#version 430
// Function of a decoder that other programs call (docs/guide/export.md).
#include "ntc/decode.glsl"

// Decodes texture `texture_number` of the pack at `uv`, from (0, 0) at the corner of the image's first texel to (1, 1), and at mip
// `lod`, as a trilinear filter reads it. `wrap` says how the texture goes on beyond, along u and v: 0 repeated, 1 mirrored, 2 clamped.
// All components are in [0, 1] and in the texture's colour space; those that the texture lacks mean nothing.
vec4 decode(int texture_number, vec2 uv, float lod, ivec2 wrap) {
    return decode_texture(textures[texture_number], uv, lod, wrap, true);
}
