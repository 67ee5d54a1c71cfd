#version 430
// Prefix sum over the pixel counts, which gives the begin of each decoder's pixels in the list. One work group handles all bins.
#include "passes/decode_binned/bins.glsl"
#include "common/work_groups.glsl"
layout(local_size_x = SCAN_GROUP) in;

uniform int bin_count;
uniform int pixels_per_group;

shared uint sums[SCAN_GROUP];

void main() {
    int lane = int(gl_LocalInvocationID.x);
    int each = (bin_count + SCAN_GROUP - 1) / SCAN_GROUP;
    int begin = min(lane * each, bin_count);
    int end = min(begin + each, bin_count);
    uint count_of_lane = 0u;
    for (int bin = begin; bin < end; ++bin) count_of_lane += bins[bin].counted;
    sums[lane] = count_of_lane;
    barrier();
    uint first = 0u;
    for (int other = 0; other < lane; ++other) first += sums[other];
    for (int bin = begin; bin < end; ++bin) {
        uint count = bins[bin].counted;
        uvec2 groups = rows_of_work_groups((count + uint(pixels_per_group) - 1u) / uint(pixels_per_group));
        bins[bin].groups_x = groups.x;
        bins[bin].groups_y = groups.y;
        bins[bin].groups_z = 1u;
        bins[bin].pixels = count;
        bins[bin].first = first;
        bins[bin].counted = 0u;
        bins[bin].placed = 0u;
        first += count;
    }
}
