// The texels on a tile's page: the tile, with a border of one texel on its right and below.
#include "common/color.glsl"
#include "ntc/records.glsl"
#include "ntc/position.glsl"

const int PAGE_TEXELS = PAGE_SIDE * PAGE_SIDE;

ivec2 place_on_page(int number) {
    return ivec2(number % PAGE_SIDE, number / PAGE_SIDE);
}

// The texel of the mip that a page stores at `texel`, on a side of `size`. Only `repeat` reads beyond the last texel, and finds the first.
int texel_read_at(int texel, int size) {
    return texel < size ? texel : 0;
}

// Coordinate at which the texel at `place` on a tile's page is decoded: its centre, in units of 2^-32.
uvec2 decoded_at(TileRecord tile, ivec2 place) {
    LevelRecord level = levels[textures[tile.texture_id].first_level + tile.level];
    ivec2 size = ivec2(level.texel_width, level.texel_height);
    ivec2 texel = ivec2(tile.tile_x, tile.tile_y) * TILE_SIDE + place;
    return uvec2(texel_centre(texel_read_at(texel.x, size.x), size.x), texel_centre(texel_read_at(texel.y, size.y), size.y));
}

ivec2 page_corner(int page) {
    return ivec2(page % PAGES_ACROSS, (page / PAGES_ACROSS) % PAGES_ACROSS) * PAGE_SIDE;
}

// Whether `stored_texel` changes decoded values.
bool is_changed(TileRecord tile) {
    return PLANE == PLANE_BASE && (textures[tile.texture_id].channels < 3 || textures[tile.texture_id].srgb == 0);
}

// Converts a decoded value to the atlas's content.
vec4 stored_texel(TileRecord tile, vec4 value) {
#if PLANE == PLANE_BASE
    vec3 rgb = textures[tile.texture_id].channels < 3 ? value.rrr : value.rgb;
    // The atlas is sRGB for linear textures too, because hardware filters it in linear light.
    if (textures[tile.texture_id].srgb == 0) rgb = linear_to_srgb(rgb);
    value = vec4(rgb, 1.0);
#endif
    return value;
}
