#version 430
// Decodes every visible pixel once, over the visibility buffer.
layout(local_size_x = 8, local_size_y = 8) in;
#define PIXELS_TOGETHER 1
#include "common/visibility.glsl"
#include "ntc/decode_plane.glsl"
#include "generated/shared_decoder.glsl"

layout(rgba32f, binding = IMAGE_TARGET) uniform writeonly image2D target;

#if DECODES_TOGETHER
void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    bool inside = all(lessThan(pixel, imageSize(target)));
    Surface own = read_surface(min(pixel, imageSize(target) - 1));
    vec4 shown = decoded_plane_together(own, pixel, inside);
    if (inside) imageStore(target, pixel, shown);
}
#else
// Pixel number `p` of this invocation. Eight invocations that follow each other, which a CPU runs at once, decode 4x2 pixels: they lie in
// few blocks of a texture.
ivec2 own_pixel(int p) {
    int lane = int(gl_LocalInvocationIndex);
    ivec2 within = ivec2(lane & 3, 2 * p + ((lane >> 2) & 1));
    return 8 * ivec2(1, PIXELS) * ivec2(gl_WorkGroupID.xy) + within + ivec2(4, 2 * PIXELS) * ivec2((lane >> 3) & 1, lane >> 4);
}

// Whether a pixel shows a texture; where it shows none, what it shows instead is stored.
bool needs_decoding(ivec2 pixel) {
    if (any(greaterThanEqual(pixel, imageSize(target)))) return false;
    Surface surface = read_surface(pixel);
    if (decoded_texture(surface) >= 0) return true;
    imageStore(target, pixel, plane_content(surface, 0, vec4(1.0)));
    return false;
}

void decode(ivec2 pixel) {
    Surface surface = read_surface(pixel);
    imageStore(target, pixel, decoded_plane(surface, pixel));
}

void main() {
#if PIXELS == 1
    ivec2 pixel = own_pixel(0);
    if (needs_decoding(pixel)) decode(pixel);
#else
    int next = 0;
    do {
        // To the next pixel with a texture: a CPU runs all of the decoding even where no invocation needs it.
        int found = -1;
        do {
            if (needs_decoding(own_pixel(next))) found = next;
            ++next;
        } while (next < PIXELS && found < 0);
        if (found >= 0) decode(own_pixel(found));
    } while (next < PIXELS);
#endif
}
#endif
