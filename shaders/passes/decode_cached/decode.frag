#version 430
// Decodes tiles, with their borders, into their pages on one layer of the atlas without compute shaders: a fragment for each texel.
#include "generated/layout.glsl"
#include "ntc/decode.glsl"
#include "passes/decode_cached/page.glsl"

layout(std430, binding = BINDING_REQUESTS) readonly buffer Tiles {
    TileRecord tiles[];
};

flat in int number;
layout(location = 0) out vec4 stored;

void main() {
    TileRecord tile = tiles[number];
    uvec2 at = decoded_at(tile, ivec2(gl_FragCoord.xy) - page_corner(tile.page));
    ivec2 wrap = ivec2(tile.wrap_u, tile.wrap_v);
    stored = stored_texel(tile, decode_at(textures[tile.texture_id], at, float(tile.level), wrap, true));
}
