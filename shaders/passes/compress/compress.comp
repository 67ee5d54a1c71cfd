#version 430
// Compresses texels to blocks, one in each invocation: BC7 (BLOCK_FORMAT 7), BC5 (5) or BC4 (4).
#include "generated/layout.glsl"
layout(local_size_x = TEXEL_GROUP) in;
#include "common/work_groups.glsl"

layout(std430, binding = BINDING_RESULTS) writeonly buffer Blocks {
    uint blocks[];
};
// Sums of the blocks' squared errors, in steps of 1/255: one of their low 11 bits, one of the higher bits.
layout(std430, binding = BINDING_DECODERS) buffer Errors {
    uint errors[];
};
uniform ivec2 size;           // of the compressed part of a mip, in texels
uniform int first_component;  // for BC5 and BC4
uniform int has_alpha;        // for BC7; 0: all texels are opaque
uniform int first_word;       // first word of the blocks
uniform int error_place;
uniform ivec2 tiles;          // x: page of the first tile; y: tiles in a row
layout(binding = UNIT_ATLAS) uniform sampler2DArray source;
#if FROM_TILES

// Tiles are on consecutive pages, row by row.
vec4 source_texel(ivec2 texel) {
    ivec2 tile = texel / TILE_SIDE;
    int page = tiles.x + tile.y * tiles.y + tile.x;
    ivec2 corner = ivec2(page % PAGES_ACROSS, (page / PAGES_ACROSS) % PAGES_ACROSS) * PAGE_SIDE;
    return texelFetch(source, ivec3(corner + texel - tile * TILE_SIDE, page / (PAGES_ACROSS * PAGES_ACROSS)), 0);
}
#else
vec4 source_texel(ivec2 texel) {
    return texelFetch(source, ivec3(texel, 0), 0);
}
#endif

#define AXIS_ROUNDS 3
#define MODE_6_ROUNDS 1
#define MODE_6_PAIRS 8
#define ROUNDS 1
#define BC4_TRIES 12
#if BLOCK_FORMAT == 7
#include "passes/compress/bc7.glsl"
#else
#include "passes/compress/bc4.glsl"
#endif

void main() {
    ivec2 blocks_of = (size + 3) / 4;
    int number = int(work_group_number()) * TEXEL_GROUP + int(gl_LocalInvocationID.x);
    if (number >= blocks_of.x * blocks_of.y) return;
    ivec2 corner = 4 * ivec2(number % blocks_of.x, number / blocks_of.x);
#if BLOCK_FORMAT != 7
    vec4 first[4], second[4];
#endif
    for (int row = 0; row < 4; ++row) {
        vec4 texels[4];
        for (int column = 0; column < 4; ++column)
            texels[column] = floor(source_texel(min(corner + ivec2(column, row), size - 1)) * 255.0 + 0.5);
#if BLOCK_FORMAT == 7
        channels[row] = vec4(texels[0].r, texels[1].r, texels[2].r, texels[3].r);
        channels[row + 4] = vec4(texels[0].g, texels[1].g, texels[2].g, texels[3].g);
        channels[row + 8] = vec4(texels[0].b, texels[1].b, texels[2].b, texels[3].b);
        channels[row + 12] = has_alpha != 0 ? vec4(texels[0].a, texels[1].a, texels[2].a, texels[3].a) : vec4(255.0);
#else
        for (int column = 0; column < 4; ++column) {
            first[row][column] = texels[column][first_component];
            second[row][column] = texels[column][min(first_component + 1, 3)];
        }
#endif
    }
    float error;
#if BLOCK_FORMAT == 7
    uvec4 block = compress_bc7(error);
    for (int word = 0; word < 4; ++word) blocks[first_word + 4 * number + word] = block[word];
#else
    uvec2 block = compress_bc4(first, error);
    const int WORDS = BLOCK_FORMAT == 5 ? 4 : 2;
    int place = first_word + WORDS * number;
    blocks[place] = block.x;
    blocks[place + 1] = block.y;
#if BLOCK_FORMAT == 5
    float second_error;
    block = compress_bc4(second, second_error);
    error += second_error;
    blocks[place + 2] = block.x;
    blocks[place + 3] = block.y;
#endif
#endif
    uint whole = uint(error + 0.5);
    atomicAdd(errors[2 * error_place], whole & 2047u);
    atomicAdd(errors[2 * error_place + 1], whole >> 11);
}
