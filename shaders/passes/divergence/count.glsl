// Counts the distinct decoders of a block of pixels (paper, Sec. 2, Eq. 1) from texture ids, without decoding.
// The count is exact for any number of decoders, because a block has at most one per pixel. docs/explanation/sharing.md.
#include "common/visibility.glsl"

layout(std430, binding = BINDING_DECODERS) readonly buffer Decoders {
    int decoder_of_texture[];   // a table of `textures` entries for each grouping, in sequence
};
uniform ivec2 picture;   // width, height in pixels
uniform int textures;    // entries of one table
uniform int rows;        // rows of blocks of one map; maps of several groupings are stacked

// D of the block at `place` in the maps.
uint count_decoders(ivec2 place) {
    int grouping = place.y / rows;
    ivec2 block = ivec2(place.x, place.y - grouping * rows);
    int decoders[BLOCK_WIDTH * BLOCK_HEIGHT];
    int count = 0;
    int last = -1;
    for (int number = 0; number < BLOCK_WIDTH * BLOCK_HEIGHT; ++number) {
        ivec2 pixel = block * ivec2(BLOCK_WIDTH, BLOCK_HEIGHT) + ivec2(number % BLOCK_WIDTH, number / BLOCK_WIDTH);
        if (any(greaterThanEqual(pixel, picture))) continue;
        // Blocks count from the top left, OpenGL's rows from the bottom.
        uint ids = texelFetch(surface_words, ivec2(pixel.x, picture.y - 1 - pixel.y), 0).x;
        int texture_id = surface_texture(ids);
        int decoder = texture_id >= 0 ? decoder_of_texture[grouping * textures + texture_id] : -1;
        if (decoder < 0 || decoder == last) continue;
        last = decoder;
        bool known = false;
        for (int other = 0; other < count; ++other) {
            if (decoders[other] == decoder) known = true;
        }
        if (!known) {
            decoders[count] = decoder;
            ++count;
        }
    }
    return uint(count);
}
