#version 430
// The pages of tiles on one layer of the atlas, a square for each.
#include "generated/layout.glsl"
#include "ntc/decode.glsl"
#include "passes/decode_cached/page.glsl"

layout(std430, binding = BINDING_REQUESTS) readonly buffer Tiles {
    TileRecord tiles[];
};

uniform int first_tile;
flat out int number;

void main() {
    number = first_tile + gl_InstanceID;
    vec2 at = vec2(page_corner(tiles[number].page) + ivec2(gl_VertexID & 1, gl_VertexID >> 1) * PAGE_SIDE);
    gl_Position = vec4(at / float(ATLAS_SIDE) * 2.0 - 1.0, 0.0, 1.0);
}
