#version 430
// Looks up places of one texture as the pixels of framebuffer blocks do, on a turned grid between two mips: for timing variants of
// codecs whose pixels share no weights (viewer/render/variants.py).
#include "generated/layout.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
#include "ntc/decode.glsl"
#if DECODES_TOGETHER
#include "generated/together.glsl"
#endif

layout(std430, binding = BINDING_RESULTS) writeonly buffer Results {
    vec4 results[];
};

const float LOD = 0.5;
const int BLOCKS_ACROSS = 32;

void main() {
    TextureRecord record = textures[0];
    LevelRecord finest = levels[record.first_level];
    int number = int(gl_WorkGroupID.x);
    vec2 pixel = vec2(ivec2(number % BLOCKS_ACROSS, number / BLOCKS_ACROSS) * 8 + ivec2(gl_LocalInvocationID.xy));
    vec2 uv = exp2(LOD) * (mat2(0.8, 0.6, -0.6, 0.8) * pixel) / vec2(finest.texel_width, finest.texel_height);
    ivec2 wrap = ivec2(WRAP_REPEAT);
    uvec2 at = fixed_coordinates(uv, wrap);
    int lane = int(gl_LocalInvocationIndex);
#if DECODES_TOGETHER
    vec4 value = decode_together(lane, true, 0, at, LOD, wrap);
#else
    vec4 value = decode_at(record, at, LOD, wrap, true);
#endif
    results[64 * number + lane] = value;
}
