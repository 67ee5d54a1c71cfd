#version 430
// Lists the texels of tiles with their borders, tile after tile, for a decoder that is not in GLSL.
#include "generated/layout.glsl"
layout(local_size_x = TEXEL_GROUP) in;
#include "passes/decode_cached/page.glsl"

layout(std430, binding = BINDING_REQUESTS) readonly buffer ListedTiles {
    TileRecord listed_tiles[];
};
layout(std430, binding = BINDING_RESULTS) writeonly buffer TexelList {
    uvec4 texel_list[];    // TEXEL_RECORD of viewer/render/resources/texel_lists.py
};
uniform int first_texel;    // of all tiles' texels, what the list begins with
uniform int texel_count;

void main() {
    int number = int(gl_GlobalInvocationID.x);
    if (number >= texel_count) return;
    TileRecord tile = listed_tiles[(first_texel + number) / PAGE_TEXELS];
    LevelRecord level = levels[textures[tile.texture_id].first_level + tile.level];
    ivec2 size = ivec2(level.texel_width, level.texel_height);
    ivec2 texel = texel_of(tile, place_on_page((first_texel + number) % PAGE_TEXELS), size);
    int texture_wrap = tile.texture_id * 16 + tile.wrap_u * 4 + tile.wrap_v;
    uvec2 at = uvec2(texel_centre(texel.x, size.x), texel_centre(texel.y, size.y));
    texel_list[number] = uvec4(at, floatBitsToUint(float(tile.level)), texture_wrap);
}
