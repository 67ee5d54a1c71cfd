#version 430
// Lists the texel that each pixel shows, row after row, for a decoder that is not in GLSL.
#include "generated/layout.glsl"
layout(local_size_x = TEXEL_GROUP) in;
#include "common/visibility.glsl"
#include "ntc/plane.glsl"
#include "ntc/lookup.glsl"

layout(std430, binding = BINDING_RESULTS) writeonly buffer TexelList {
    uvec4 texel_list[];    // TEXEL_RECORD of viewer/render/resources/texel_lists.py
};
uniform int first_texel;    // number of the pixel that the list begins with
uniform int texel_count;

void main() {
    int number = int(gl_GlobalInvocationID.x);
    if (number >= texel_count) return;
    int width = textureSize(surface_words, 0).x;
    ivec2 pixel = ivec2((first_texel + number) % width, (first_texel + number) / width);
    WantedTexel wanted = wanted_texel(read_surface(pixel));
    uvec4 texel = uvec4(0u, 0u, 0u, ~0u);
    if (wanted.texture_id >= 0) {
        Lookup lookup = lookup_of(textures[wanted.texture_id], wanted.uv, wanted.lod, wanted.wrap, pixel);
        int texture_wrap = wanted.texture_id * 16 + wanted.wrap.x * 4 + wanted.wrap.y;
        texel = uvec4(lookup.at, floatBitsToUint(lookup.lod), texture_wrap);
    }
    texel_list[number] = texel;
}
