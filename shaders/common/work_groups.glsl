// Numbers of the work groups of a dispatch with one or several rows (viewer/gl/limits.py).

#include "generated/layout.glsl"

// Number of this work group, row by row. The last row may hold surplus groups, with numbers beyond the last wanted one.
uint work_group_number() {
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}

// Width and height of a dispatch of at least `groups` work groups.
uvec2 rows_of_work_groups(uint groups) {
    uint rows = max((groups + uint(GROUPS_ACROSS) - 1u) / uint(GROUPS_ACROSS), 1u);
    return uvec2((groups + rows - 1u) / rows, rows);
}
