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
    TextureRecord record = textures[tile.texture_id];
    LevelRecord level = levels[record.first_level + tile.level];
    ivec2 size = ivec2(level.texel_width, level.texel_height);
    ivec2 texel = texel_of(tile, ivec2(gl_FragCoord.xy) - page_corner(tile.page), size);
    uvec2 at = uvec2(texel_centre(texel.x, size.x), texel_centre(texel.y, size.y));
    stored = stored_texel(tile, decode_at(record, at, float(tile.level), ivec2(tile.wrap_u, tile.wrap_v), true));
}
