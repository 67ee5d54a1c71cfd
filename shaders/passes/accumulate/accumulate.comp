#version 430
// Adds one more sample of the albedo to the mean of those before it.
#include "generated/layout.glsl"
layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;

layout(rgba32f, binding = IMAGE_ALBEDO) uniform image2D albedo;
layout(rgba32f, binding = IMAGE_SAMPLE) uniform readonly image2D albedo_sample;
uniform int samples_before;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(albedo)))) return;
    vec4 mean = imageLoad(albedo, pixel);
    mean += (imageLoad(albedo_sample, pixel) - mean) / float(samples_before + 1);
    imageStore(albedo, pixel, mean);
}
