// Buffers and functions that the steps of culling by clusters share (viewer/render/resources/clusters.py).
#include "generated/clusters.glsl"

layout(std430, binding = BINDING_CLUSTERS) readonly buffer Clusters { ClusterRecord clusters[]; };
layout(std430, binding = BINDING_PLACEMENTS) readonly buffer Placements { PlacementRecord placements[]; };
layout(std430, binding = BINDING_ITEMS) buffer Items { ItemRecord items[]; };
layout(std430, binding = BINDING_COMMANDS) writeonly buffer Commands { uint commands[]; };
layout(std430, binding = BINDING_BUCKETS) buffer Buckets { BucketRecord buckets[]; };

uniform uint item_count;

// True where cluster `lane` of an item may be seen.
bool is_seen(ItemRecord item, uint lane) {
    return ((lane < 32u ? item.seen_low : item.seen_high) >> (lane & 31u) & 1u) != 0u;
}
