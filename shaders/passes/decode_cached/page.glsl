// The texels of a tile: those on its page, one of border included.
#include "common/color.glsl"
#include "ntc/records.glsl"
#include "ntc/position.glsl"

const int PAGE_TEXELS = PAGE_SIDE * PAGE_SIDE;

ivec2 place_on_page(int number) {
    return ivec2(number % PAGE_SIDE, number / PAGE_SIDE);
}

// `texel` of a side of `size` by the wrap mode; it may lie outside.
int wrapped_texel(int texel, int size, int mode) {
    if (mode == WRAP_CLAMP) return clamp(texel, 0, size - 1);
    int period = mode == WRAP_MIRROR ? 2 * size : size;
    // Never negative, for which % is undefined: the border is one texel wide.
    int inside = (texel + period) % period;
    return inside < size ? inside : period - 1 - inside;
}

ivec2 texel_of(TileRecord tile, ivec2 place, ivec2 size) {
    ivec2 texel = ivec2(tile.tile_x, tile.tile_y) * TILE_SIDE + place - TILE_BORDER;
    return ivec2(wrapped_texel(texel.x, size.x, tile.wrap_u), wrapped_texel(texel.y, size.y, tile.wrap_v));
}

// Centre of the texel at `place` on a tile's page, where it is decoded, in units of 2^-32.
uvec2 decoded_at(TileRecord tile, ivec2 place) {
    LevelRecord level = levels[textures[tile.texture_id].first_level + tile.level];
    ivec2 size = ivec2(level.texel_width, level.texel_height);
    ivec2 texel = texel_of(tile, place, size);
    return uvec2(texel_centre(texel.x, size.x), texel_centre(texel.y, size.y));
}

ivec2 page_corner(int page) {
    return ivec2(page % PAGES_ACROSS, (page / PAGES_ACROSS) % PAGES_ACROSS) * PAGE_SIDE;
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
