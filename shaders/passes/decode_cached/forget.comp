#version 430
// Tiles that are no longer there, or that nobody is asking for any more.
#include "generated/layout.glsl"
layout(local_size_x = TEXEL_GROUP) in;

layout(std430, binding = BINDING_REQUESTS) readonly buffer Forgotten {
    uint forgotten[];   // entries
};
layout(std430, binding = BINDING_TILE_ENTRIES) writeonly buffer TileEntries {
    uint tile_entries[];
};
uniform int count;

void main() {
    int number = int(gl_GlobalInvocationID.x);
    if (number < count) tile_entries[forgotten[number]] = 0u;
}
