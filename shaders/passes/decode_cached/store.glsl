// Writing decoded texels of tiles into the atlas.
#include "common/color.glsl"
#include "ntc/records.glsl"

layout(rgba8, binding = IMAGE_ATLAS) uniform writeonly image2DArray atlas;
layout(std430, binding = BINDING_TILE_ENTRIES) writeonly buffer TileEntries {
    uint tile_entries[];
};

void store_texel(TileRecord tile, ivec2 place, vec4 value) {
#if PLANE == PLANE_BASE
    vec3 rgb = textures[tile.texture_id].channels < 3 ? value.rrr : value.rgb;
    // The atlas holds sRGB for linear textures, too: the hardware filters it in linear light.
    if (textures[tile.texture_id].srgb == 0) rgb = linear_to_srgb(rgb);
    value = vec4(rgb, 1.0);
#endif
    ivec2 page = ivec2(tile.page % PAGES_ACROSS, (tile.page / PAGES_ACROSS) % PAGES_ACROSS);
    imageStore(atlas, ivec3(page * PAGE_SIDE + place, tile.page / (PAGES_ACROSS * PAGES_ACROSS)), value);
    if (place == ivec2(0)) tile_entries[tile.entry] = uint(tile.page + 1);
}
