#version 430
// Adds one more sample of a picture to the mean of those before it.
#include "generated/layout.glsl"
layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(rgba32f, binding = IMAGE_TARGET) uniform image2D mean_image;
layout(rgba32f, binding = IMAGE_SAMPLE) uniform readonly image2D sample_image;
uniform int samples_before;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(mean_image)))) return;
    vec4 mean = imageLoad(mean_image, pixel);
    mean += (imageLoad(sample_image, pixel) - mean) / float(samples_before + 1);
    imageStore(mean_image, pixel, mean);
}
