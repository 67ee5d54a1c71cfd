#version 430
// Writes the plane's content of the pixels whose texels were listed and decoded.
#include "generated/layout.glsl"
layout(local_size_x = TEXEL_GROUP) in;
#include "common/visibility.glsl"
#include "ntc/plane.glsl"

layout(rgba32f, binding = IMAGE_TARGET) uniform writeonly image2D target;
layout(std430, binding = BINDING_RESULTS) readonly buffer TexelValues {
    vec4 texel_values[];
};
uniform int first_texel;
uniform int texel_count;

void main() {
    int number = int(gl_GlobalInvocationID.x);
    if (number >= texel_count) return;
    int width = imageSize(target).x;
    ivec2 pixel = ivec2((first_texel + number) % width, (first_texel + number) / width);
    Surface surface = read_surface(pixel);
    imageStore(target, pixel, shown_plane(surface, wanted_texel(surface), texel_values[number]));
}
