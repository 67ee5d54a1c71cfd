#version 430
// Decodes each visible pixel once, from the visibility buffer.
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
    Surface surface = read_surface(min(pixel, imageSize(target) - 1));
    vec4 shown = decoded_plane_together(surface, pixel, inside);
    if (inside) imageStore(target, pixel, shown);
}
#else
// Pixel number `p` of this invocation. A CPU runs eight consecutive invocations at once; they decode 4x2 pixels, which lie in few blocks of a
// texture.
ivec2 pixel_of(int p) {
    int lane = int(gl_LocalInvocationIndex);
    ivec2 within = ivec2(lane & 3, 2 * p + ((lane >> 2) & 1));
    return 8 * ivec2(1, PIXELS) * ivec2(gl_WorkGroupID.xy) + within + ivec2(4, 2 * PIXELS) * ivec2((lane >> 3) & 1, lane >> 4);
}

// Returns whether a pixel shows a texture. If not, its colour is stored here.
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
    ivec2 pixel = pixel_of(0);
    if (needs_decoding(pixel)) decode(pixel);
#else
    int next = 0;
    do {
        // Skip to the next textured pixel: a CPU runs the whole decode even if no invocation needs it.
        int textured = -1;
        do {
            if (needs_decoding(pixel_of(next))) textured = next;
            ++next;
        } while (next < PIXELS && textured < 0);
        if (textured >= 0) decode(pixel_of(textured));
    } while (next < PIXELS);
#endif
}
#endif
