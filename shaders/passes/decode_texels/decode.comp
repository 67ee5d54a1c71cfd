#version 430
// Decodes single texels, for `ntc-viewer decode --backend gl` and for comparison with the reference.
#include "generated/layout.glsl"
layout(local_size_x = 64) in;
#include "ntc/decode.glsl"

layout(std430, binding = BINDING_REQUESTS) readonly buffer Requests {
    RequestRecord requests[];
};
layout(std430, binding = BINDING_RESULTS) writeonly buffer Results {
    vec4 results[];
};
uniform int count;

#if DECODES_TOGETHER
#include "generated/together.glsl"

void main() {
    int number = int(gl_GlobalInvocationID.x);
    RequestRecord request = requests[min(number, count - 1)];
    ivec2 wrap = ivec2((request.texture_wrap >> 2) & 3, request.texture_wrap & 3);
    uvec2 at = fixed_coordinates(request.uv, wrap);
    vec4 value = decode_together(int(gl_LocalInvocationID.x), number < count, request.texture_wrap >> 4, at, request.lod, wrap);
    if (number < count) results[number] = value;
}
#else
void main() {
    int number = int(gl_GlobalInvocationID.x);
    if (number >= count) return;
    RequestRecord request = requests[number];
    ivec2 wrap = ivec2((request.texture_wrap >> 2) & 3, request.texture_wrap & 3);
    results[number] = decode_texture(textures[request.texture_wrap >> 4], request.uv, request.lod, wrap, true);
}
#endif
