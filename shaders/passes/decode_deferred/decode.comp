#version 430
// Decodes every visible pixel once, over the visibility buffer.
layout(local_size_x = 8, local_size_y = 8) in;
#define PIXELS_TOGETHER 1
#include "common/visibility.glsl"
#include "ntc/decode_plane.glsl"

layout(rgba32f, binding = IMAGE_TARGET) uniform writeonly image2D target;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
#if DECODES_TOGETHER
    bool inside = all(lessThan(pixel, imageSize(target)));
    Surface own = read_surface(min(pixel, imageSize(target) - 1));
    vec4 shown = decoded_plane_together(own, pixel, inside);
    if (inside) imageStore(target, pixel, shown);
#else
    if (any(greaterThanEqual(pixel, imageSize(target)))) return;
    Surface surface = read_surface(pixel);
    imageStore(target, pixel, decoded_plane(surface, pixel));
#endif
}
