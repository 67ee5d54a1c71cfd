#version 430
// Distinct decoders of each block of pixels (paper, Sec. 2, Eq. 1), from texture ids alone: nothing is decoded for it.
// One invocation for each block. Exact for any number of decoders: a block has no more than it has pixels.
layout(local_size_x = 8, local_size_y = 8) in;
#include "common/visibility.glsl"

layout(std430, binding = BINDING_DECODERS) readonly buffer Decoders {
    int decoder_of_texture[];
};
layout(r32ui, binding = IMAGE_DIVERGENCE) uniform writeonly uimage2D divergence;
uniform ivec2 picture;   // width, height in pixels

void main() {
    ivec2 block = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(block, imageSize(divergence)))) return;
    int found[BLOCK_WIDTH * BLOCK_HEIGHT];
    int count = 0;
    int last = -1;
    for (int number = 0; number < BLOCK_WIDTH * BLOCK_HEIGHT; ++number) {
        ivec2 pixel = block * ivec2(BLOCK_WIDTH, BLOCK_HEIGHT) + ivec2(number % BLOCK_WIDTH, number / BLOCK_WIDTH);
        if (any(greaterThanEqual(pixel, picture))) continue;
        // Blocks are counted from the top left, OpenGL's rows from the bottom.
        uint ids = texelFetch(surface_words, ivec2(pixel.x, picture.y - 1 - pixel.y), 0).x;
        int texture_id = surface_texture(ids);
        int decoder = texture_id >= 0 ? decoder_of_texture[texture_id] : -1;
        if (decoder < 0 || decoder == last) continue;
        last = decoder;
        bool known = false;
        for (int other = 0; other < count; ++other) {
            if (found[other] == decoder) known = true;
        }
        if (!known) {
            found[count] = decoder;
            ++count;
        }
    }
    imageStore(divergence, block, uvec4(count));
}
