#version 430
// Computes where each item's draw commands begin in its bucket, and how many the bucket has: a prefix sum, one work group per bucket.
// Commands are in the order of items, not of execution. So the same one of two surfaces at equal depth is always visible.
#include "passes/cull_clusters/clusters.glsl"
layout(local_size_x = SCAN_GROUP) in;

shared uint sums[SCAN_GROUP];
shared uint clusters_seen;
shared uint triangles_seen;

void main() {
    uint bucket = gl_WorkGroupID.x;
    uint lane = gl_LocalInvocationID.x;
    if (lane == 0u) clusters_seen = triangles_seen = 0u;
    uint count = buckets[bucket].items;
    uint each = (count + uint(SCAN_GROUP) - 1u) / uint(SCAN_GROUP);
    uint begin = buckets[bucket].first_item + min(lane * each, count);
    uint end = buckets[bucket].first_item + min((lane + 1u) * each, count);
    uint runs = 0u;
    uint cluster_count = 0u;
    uint triangle_count = 0u;
    for (uint item = begin; item < end; ++item) {
        runs += items[item].runs;
        cluster_count += uint(bitCount(items[item].seen_low) + bitCount(items[item].seen_high));
        triangle_count += items[item].triangles;
    }
    sums[lane] = runs;
    barrier();
    atomicAdd(clusters_seen, cluster_count);
    atomicAdd(triangles_seen, triangle_count);
    uint first = buckets[bucket].first_command;
    for (uint other = 0u; other < lane; ++other) first += sums[other];
    for (uint item = begin; item < end; ++item) {
        items[item].first_command = first;
        first += items[item].runs;
    }
    uint total = 0u;
    for (uint other = 0u; other < uint(SCAN_GROUP); ++other) total += sums[other];
    barrier();
    if (lane == 0u) {
        buckets[bucket].commands = total;
        buckets[bucket].clusters = clusters_seen;
        buckets[bucket].triangles = triangles_seen;
    }
#if PADDED
    // The CPU draws the largest possible number of commands, so the rest are empty.
    uint place = buckets[bucket].first_command;
    for (uint empty = total + lane; empty < buckets[bucket].capacity; empty += uint(SCAN_GROUP))
        for (uint word = 0u; word < COMMAND_WORDS; ++word) commands[(place + empty) * COMMAND_WORDS + word] = 0u;
#endif
}
