#version 430
// Decodes single texels: for `ntc-viewer decode --backend gl` and for comparing with the reference.
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

void main() {
    int number = int(gl_GlobalInvocationID.x);
    if (number >= count) return;
    RequestRecord request = requests[number];
    ivec2 wrap = ivec2((request.texture_wrap >> 2) & 3, request.texture_wrap & 3);
    results[number] = decode_texture(textures[request.texture_wrap >> 4], request.uv, request.lod, wrap, true);
}
