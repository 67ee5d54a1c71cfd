#version 430
// One more sample of a picture; blending adds it to the mean of those before it.
#include "generated/layout.glsl"

layout(binding = UNIT_PICTURE_A) uniform sampler2D sample_picture;
layout(location = 0) out vec4 mean;

void main() {
    mean = texelFetch(sample_picture, ivec2(gl_FragCoord.xy), 0);
}
