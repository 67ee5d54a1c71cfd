#version 430
// Adds a sample of the picture to the mean of the previous ones, by blending.
#include "generated/layout.glsl"

layout(binding = UNIT_PICTURE_A) uniform sampler2D sample_picture;
uniform float weight;   // weight of this sample

layout(location = 0, index = 0) out vec4 mean;
// Dual-source blending, because zink of Mesa 22.3 ignores a changed constant blend colour until the next draw.
layout(location = 0, index = 1) out vec4 weights;

void main() {
    mean = texelFetch(sample_picture, ivec2(gl_FragCoord.xy), 0);
    weights = vec4(weight);
}
