// Work groups of a dispatch in one row or several (viewer/gl/limits.py), counted row by row.

#include "generated/layout.glsl"

// Number of this invocation's work group; some beyond the last wanted one fill up the last row.
uint work_group_number() {
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}

// Width and height of a dispatch of at least `groups` work groups.
uvec2 rows_of_work_groups(uint groups) {
    uint rows = max((groups + uint(GROUPS_ACROSS) - 1u) / uint(GROUPS_ACROSS), 1u);
    return uvec2((groups + rows - 1u) / rows, rows);
}
