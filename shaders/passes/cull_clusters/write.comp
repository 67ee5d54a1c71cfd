#version 430
// Writes the draw command of each run of visible clusters (DrawElementsIndirectCommand; OpenGL 4.3, Sec. 10.4).
#include "passes/cull_clusters/clusters.glsl"
#include "common/work_groups.glsl"
layout(local_size_x = ITEM_CLUSTERS) in;

void main() {
    uint number = work_group_number();
    uint lane = gl_LocalInvocationID.x;
    if (number >= item_count) return;
    ItemRecord item = items[number];
    if (!is_seen(item, lane) || (lane > 0u && is_seen(item, lane - 1u))) return;
    uint before = 0u;
    for (uint other = 0u; other < lane; ++other)
        if (is_seen(item, other) && (other == 0u || !is_seen(item, other - 1u))) ++before;
    uint last = lane;
    while (last + 1u < item.clusters && is_seen(item, last + 1u)) ++last;
    ClusterRecord from = clusters[item.first_cluster + lane];
    ClusterRecord to = clusters[item.first_cluster + last];
    uint first_index = from.first_index;
    uint place = (item.first_command + before) * COMMAND_WORDS;
    commands[place] = to.first_index + to.index_count - first_index;
    commands[place + 1u] = 1u;
    commands[place + 2u] = first_index;
    commands[place + 3u] = placements[item.instance].base_vertex;
    commands[place + 4u] = item.instance;
}
