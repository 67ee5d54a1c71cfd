#version 430
// Where each item's draws begin among those of its bucket, and how many the bucket has. One work group for each bucket.
// The order is that of the items, whatever ran first: which of two surfaces at the same depth is seen must not change.
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
    uint own = 0u;
    uint own_clusters = 0u;
    uint own_triangles = 0u;
    for (uint item = begin; item < end; ++item) {
        own += items[item].runs;
        own_clusters += uint(bitCount(items[item].seen_low) + bitCount(items[item].seen_high));
        own_triangles += items[item].triangles;
    }
    sums[lane] = own;
    barrier();
    atomicAdd(clusters_seen, own_clusters);
    atomicAdd(triangles_seen, own_triangles);
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
    // The CPU draws as many as there may be.
    uint place = buckets[bucket].first_command;
    for (uint empty = total + lane; empty < buckets[bucket].capacity; empty += uint(SCAN_GROUP))
        for (uint word = 0u; word < COMMAND_WORDS; ++word) commands[(place + empty) * COMMAND_WORDS + word] = 0u;
#endif
}
