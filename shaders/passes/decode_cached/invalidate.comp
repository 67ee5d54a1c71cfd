#version 430
// Clears the table entries of evicted tiles and of dropped requests.
#include "generated/layout.glsl"
layout(local_size_x = TEXEL_GROUP) in;

layout(std430, binding = BINDING_REQUESTS) readonly buffer Invalidated {
    uint invalidated[];   // indices into tile_entries
};
layout(std430, binding = BINDING_TILE_ENTRIES) writeonly buffer TileEntries {
    uint tile_entries[];
};
uniform int count;

void main() {
    int number = int(gl_GlobalInvocationID.x);
    if (number < count) tile_entries[invalidated[number]] = 0u;
}
