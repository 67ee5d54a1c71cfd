// The texels of a tile: those on its page, one of border included.
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
