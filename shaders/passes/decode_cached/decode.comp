#version 430
// Decodes the tiles of one decoder into their pages of the atlas, border and all: several texels in each invocation.
#include "generated/layout.glsl"
layout(local_size_x = BIN_GROUP) in;
#include "common/color.glsl"
#include "ntc/decode.glsl"
#include "generated/shared_network.glsl"

layout(rgba8, binding = IMAGE_ATLAS) uniform writeonly image2DArray atlas;
layout(std430, binding = BINDING_REQUESTS) readonly buffer Tiles {
    TileRecord tiles[];
};
layout(std430, binding = BINDING_TILE_ENTRIES) writeonly buffer TileEntries {
    uint tile_entries[];
};
uniform int first_tile;
uniform int tile_count;

const int PAGE_TEXELS = PAGE_SIDE * PAGE_SIDE;

// The texel that stands at `texel` of a side of `size`, which may lie outside.
int wrapped_texel(int texel, int size, int mode) {
    if (mode == WRAP_CLAMP) return clamp(texel, 0, size - 1);
    int period = mode == WRAP_MIRROR ? 2 * size : size;
    // Never negative, for which % is undefined: the border is one texel wide.
    int inside = (texel + period) % period;
    return inside < size ? inside : period - 1 - inside;
}

void main() {
    int texels = tile_count * PAGE_TEXELS;
    int first = int(gl_WorkGroupID.x) * BIN_GROUP * PIXELS + int(gl_LocalInvocationID.x);
    if (first >= texels) return;
    int adapters[PIXELS];
    float x[PIXELS][DECODER_INPUTS];
    for (int p = 0; p < PIXELS; ++p) {
        int number = min(first + p * BIN_GROUP, texels - 1);
        TileRecord tile = tiles[first_tile + number / PAGE_TEXELS];
        int place = number % PAGE_TEXELS;
        TextureRecord record = textures[tile.texture_id];
        LevelRecord level = levels[record.first_level + tile.level];
        ivec2 size = ivec2(level.texel_width, level.texel_height);
        ivec2 texel = ivec2(tile.tile_x, tile.tile_y) * TILE_SIDE + ivec2(place % PAGE_SIDE, place / PAGE_SIDE) - TILE_BORDER;
        ivec2 wrap = ivec2(tile.wrap_u, tile.wrap_v);
        texel = ivec2(wrapped_texel(texel.x, size.x, wrap.x), wrapped_texel(texel.y, size.y, wrap.y));
        decoder_input(record, (vec2(texel) + 0.5) / vec2(size), float(tile.level), wrap, x[p]);
        adapters[p] = record.adapter;
    }
    vec4 decoded[PIXELS];
    run_decoders(adapters, x, network_blocks, decoded);
    for (int p = 0; p < PIXELS; ++p) {
        int number = first + p * BIN_GROUP;
        if (number >= texels) continue;
        TileRecord tile = tiles[first_tile + number / PAGE_TEXELS];
        int place = number % PAGE_TEXELS;
        vec4 value = clamp(decoded[p], 0.0, 1.0);
        vec3 rgb = textures[tile.texture_id].channels < 3 ? value.rrr : value.rgb;
        // The atlas holds sRGB, whatever the texture: the hardware filters it in linear light.
        if (textures[tile.texture_id].srgb == 0) rgb = linear_to_srgb(rgb);
        ivec2 page = ivec2(tile.page % PAGES_ACROSS, (tile.page / PAGES_ACROSS) % PAGES_ACROSS);
        ivec2 texel = page * PAGE_SIDE + ivec2(place % PAGE_SIDE, place / PAGE_SIDE);
        imageStore(atlas, ivec3(texel, tile.page / (PAGES_ACROSS * PAGES_ACROSS)), vec4(rgb, 1.0));
        if (place == 0) tile_entries[tile.entry] = uint(tile.page + 1);
    }
}
