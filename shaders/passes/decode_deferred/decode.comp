#version 430
// Decodes every visible pixel once, over the visibility buffer.
layout(local_size_x = 8, local_size_y = 8) in;
#include "common/visibility.glsl"
#include "ntc/albedo.glsl"

layout(rgba32f, binding = IMAGE_ALBEDO) uniform writeonly image2D albedo;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(albedo)))) return;
    Surface surface = read_surface(pixel);
    imageStore(albedo, pixel, vec4(decoded_albedo(surface, pixel), surface.material >= 0 ? 1.0 : 0.0));
}
