// Writing decoded texels of tiles into the atlas.
#include "passes/decode_cached/page.glsl"

layout(rgba8, binding = IMAGE_ATLAS) uniform writeonly image2DArray atlas;
layout(std430, binding = BINDING_TILE_ENTRIES) writeonly buffer TileEntries {
    uint tile_entries[];
};

void store_texel(TileRecord tile, ivec2 place, vec4 value) {
    ivec3 at = ivec3(page_corner(tile.page) + place, tile.page / (PAGES_ACROSS * PAGES_ACROSS));
    imageStore(atlas, at, stored_texel(tile, value));
    if (place == ivec2(0)) tile_entries[tile.entry] = uint(tile.page + 1);
}
