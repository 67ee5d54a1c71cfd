// Culling of clusters on the GPU: buffers and functions of its steps (viewer/render/resources/clusters.py).
//
// A cluster is up to 512 triangles. An item is up to 64 clusters of one instance. A bucket is the items that one multi-draw call draws.
// The steps: test.comp marks the clusters of each item that may be visible. scan.comp computes by a prefix sum where the draw commands of
// each item begin. write.comp writes one command for each run of neighbouring visible clusters. docs/explanation/decode-paths.md#a-frame.
#include "generated/clusters.glsl"

layout(std430, binding = BINDING_CLUSTERS) readonly buffer Clusters { ClusterRecord clusters[]; };
layout(std430, binding = BINDING_PLACEMENTS) readonly buffer Placements { PlacementRecord placements[]; };
layout(std430, binding = BINDING_ITEMS) buffer Items { ItemRecord items[]; };
layout(std430, binding = BINDING_COMMANDS) writeonly buffer Commands { uint commands[]; };
layout(std430, binding = BINDING_BUCKETS) buffer Buckets { BucketRecord buckets[]; };

uniform uint item_count;

// Whether cluster `lane` of an item may be visible.
bool is_seen(ItemRecord item, uint lane) {
    return ((lane < 32u ? item.seen_low : item.seen_high) >> (lane & 31u) & 1u) != 0u;
}
