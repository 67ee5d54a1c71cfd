#version 430
// Writes the texels of tiles that were listed and decoded into their pages of the atlas.
#include "generated/layout.glsl"
layout(local_size_x = TEXEL_GROUP) in;
#include "passes/decode_cached/page.glsl"
#include "passes/decode_cached/store.glsl"

layout(std430, binding = BINDING_REQUESTS) readonly buffer ListedTiles {
    TileRecord listed_tiles[];
};
layout(std430, binding = BINDING_RESULTS) readonly buffer TexelValues {
    vec4 texel_values[];
};
uniform int first_texel;
uniform int texel_count;

void main() {
    int number = int(gl_GlobalInvocationID.x);
    if (number >= texel_count) return;
    TileRecord tile = listed_tiles[(first_texel + number) / PAGE_TEXELS];
    store_texel(tile, place_on_page((first_texel + number) % PAGE_TEXELS), texel_values[number]);
}
