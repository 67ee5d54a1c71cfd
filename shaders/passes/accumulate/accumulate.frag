#version 430
// One more sample of a picture; blending adds it to the mean of those before it.
#include "generated/layout.glsl"

layout(binding = UNIT_PICTURE_A) uniform sampler2D sample_picture;
uniform float weight;   // of the sample

layout(location = 0, index = 0) out vec4 mean;
// Not the constant blend colour: zink of Mesa 22.3 does not set a new one before the next draw.
layout(location = 0, index = 1) out vec4 weights;

void main() {
    mean = texelFetch(sample_picture, ivec2(gl_FragCoord.xy), 0);
    weights = vec4(weight);
}
