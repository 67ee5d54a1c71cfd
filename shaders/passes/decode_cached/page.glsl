// The texels of a tile: those on its page, with its border on the right and below.
#include "common/color.glsl"
#include "ntc/records.glsl"
#include "ntc/position.glsl"

const int PAGE_TEXELS = PAGE_SIDE * PAGE_SIDE;

ivec2 place_on_page(int number) {
    return ivec2(number % PAGE_SIDE, number / PAGE_SIDE);
}

// The texel of a side of `size` that is kept at `texel`. What lies beyond the last one is read under `repeat` alone: it is the first one.
int kept_texel(int texel, int size) {
    return texel < size ? texel : 0;
}

// Centre of the texel at `place` on a tile's page, where it is decoded, in units of 2^-32.
uvec2 decoded_at(TileRecord tile, ivec2 place) {
    LevelRecord level = levels[textures[tile.texture_id].first_level + tile.level];
    ivec2 size = ivec2(level.texel_width, level.texel_height);
    ivec2 texel = ivec2(tile.tile_x, tile.tile_y) * TILE_SIDE + place;
    return uvec2(texel_centre(kept_texel(texel.x, size.x), size.x), texel_centre(kept_texel(texel.y, size.y), size.y));
}

ivec2 page_corner(int page) {
    return ivec2(page % PAGES_ACROSS, (page / PAGES_ACROSS) % PAGES_ACROSS) * PAGE_SIDE;
}

// Whether the atlas holds other colours than those that are decoded.
bool is_changed(TileRecord tile) {
    return PLANE == PLANE_BASE && (textures[tile.texture_id].channels < 3 || textures[tile.texture_id].srgb == 0);
}

// Content of the atlas for a decoded value.
vec4 stored_texel(TileRecord tile, vec4 value) {
#if PLANE == PLANE_BASE
    vec3 rgb = textures[tile.texture_id].channels < 3 ? value.rrr : value.rgb;
    // The atlas holds sRGB for linear textures, too: the hardware filters it in linear light.
    if (textures[tile.texture_id].srgb == 0) rgb = linear_to_srgb(rgb);
    value = vec4(rgb, 1.0);
#endif
    return value;
}
