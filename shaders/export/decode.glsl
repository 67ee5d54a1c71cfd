#version 430
// The function of an exported decoder that programs call (docs/guide/export.md).
#include "ntc/decode.glsl"

// Decodes texture `texture_number` of the pack at `uv`, from (0, 0) at the corner of the image's first texel to (1, 1), and at mip
// `lod`, filtered trilinearly. `wrap` is the wrap mode along u and v: 0 repeat, 1 mirror, 2 clamp.
// All components are in [0, 1] and in the texture's colour space; those that the texture lacks are undefined.
vec4 decode(int texture_number, vec2 uv, float lod, ivec2 wrap) {
    return decode_texture(textures[texture_number], uv, lod, wrap, true);
}
