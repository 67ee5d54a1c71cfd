#version 430
// Tests which clusters may be visible. A cluster is dropped if one of three tests proves that it covers no pixel:
// 1. Frustum: its bounding box is outside one of the six planes, in clip space. The box's extents along u, v and w are added to its centre.
// 2. Cone: all its triangles face away from the eye. Their normals lie in a cone around `axis`; the test is that of Shirman and Abi-Ezzi
//    1993, "The cone of normals technique", widened by the size of the box.
// 3. Size: the box on the screen holds no pixel centre.
// Rounding errors are bounded and counted in favour of the cluster, so culling never changes the picture.
// Twin in numpy: tests/gl/cluster_twin.py.
#include "passes/cull_clusters/clusters.glsl"
#include "common/work_groups.glsl"
layout(local_size_x = ITEM_CLUSTERS) in;

uniform mat4 view_projection;
uniform vec2 picture_size;   // pixels
uniform uint tests;          // TEST_* bits

shared uint seen[2];
shared uint triangles;

bool may_be_seen(ClusterRecord cluster, PlacementRecord placement, vec3 eye) {
    mat3x4 rows = mat3x4(placement.row_x, placement.row_y, placement.row_z);
    vec4 middle = vec4(cluster.centre.xyz, 1.0);
    vec3 extent = cluster.extent.xyz;
    vec4 at = view_projection * vec4(middle * rows, 1.0);
    vec4 u = view_projection * vec4(rows[0].x * extent.x, rows[1].x * extent.x, rows[2].x * extent.x, 0.0);
    vec4 v = view_projection * vec4(rows[0].y * extent.y, rows[1].y * extent.y, rows[2].y * extent.y, 0.0);
    vec4 w = view_projection * vec4(rows[0].z * extent.z, rows[1].z * extent.z, rows[2].z * extent.z, 0.0);
    // Bound of the rounding errors, here and in the vertex shader, from the largest intermediate numbers.
    vec4 largest = vec4(abs(middle.xyz) + extent, 1.0);
    vec4 reach = vec4(dot(abs(rows[0]), largest), dot(abs(rows[1]), largest), dot(abs(rows[2]), largest), 1.0);
    vec4 error = ROUNDING * (mat4(abs(view_projection[0]), abs(view_projection[1]), abs(view_projection[2]),
                                  abs(view_projection[3])) * reach);

    if ((tests & TEST_FRUSTUM) != 0u) {
        vec3 slack = vec3(-error.w) - error.xyz;
        vec3 above = vec3(at.w) + at.xyz + abs(u.w + u.xyz) + abs(v.w + v.xyz) + abs(w.w + w.xyz);
        vec3 below = vec3(at.w) - at.xyz + abs(u.w - u.xyz) + abs(v.w - v.xyz) + abs(w.w - w.xyz);
        if (any(lessThan(above, slack)) || any(lessThan(below, slack))) return false;
    }
    if ((tests & TEST_CONE) != 0u && placement.may_face_away != 0u && cluster.axis.w <= 1.0) {
        vec3 towards = cluster.centre.xyz - eye;
        float away = length(towards);
        float doubt = CONE_MARGIN * away + ROUNDING * (length(cluster.centre.xyz) + length(eye));
        if (dot(towards, cluster.axis.xyz) >= cluster.axis.w * away + length(extent) + doubt) return false;
    }
    float nearest = at.w - abs(u.w) - abs(v.w) - abs(w.w) - error.w;
    if ((tests & TEST_SIZE) != 0u && nearest > 0.0) {
        vec2 low = vec2(1e30);
        vec2 high = vec2(-1e30);
        for (uint corner = 0u; corner < 8u; ++corner) {
            vec4 place = at + ((corner & 1u) != 0u ? u : -u) + ((corner & 2u) != 0u ? v : -v) + ((corner & 4u) != 0u ? w : -w);
            low = min(low, place.xy / place.w);
            high = max(high, place.xy / place.w);
        }
        vec2 doubt = (error.xy + error.w * max(abs(low), abs(high))) / nearest;
        low = ((low - doubt) * 0.5 + 0.5) * picture_size - PIXEL_MARGIN;
        high = ((high + doubt) * 0.5 + 0.5) * picture_size + PIXEL_MARGIN;
        // Pixels are sampled at their centres.
        if (any(lessThan(floor(high - 0.5), ceil(low - 0.5)))) return false;
    }
    return true;
}

void main() {
    uint number = work_group_number();
    uint lane = gl_LocalInvocationID.x;
    if (lane < 2u) seen[lane] = 0u;
    if (lane == 2u) triangles = 0u;
    barrier();
    if (number < item_count && lane < items[number].clusters) {
        ClusterRecord cluster = clusters[items[number].first_cluster + lane];
        if (may_be_seen(cluster, placements[items[number].instance], items[number].eye.xyz)) {
            atomicOr(seen[lane >> 5u], 1u << (lane & 31u));
            atomicAdd(triangles, cluster.index_count / 3u);
        }
    }
    barrier();
    if (number < item_count && lane == 0u) {
        uint low = seen[0];
        uint high = seen[1];
        items[number].seen_low = low;
        items[number].seen_high = high;
        items[number].triangles = triangles;
        // A run of neighbouring clusters is one draw.
        items[number].runs = uint(bitCount(low & ~(low << 1u)) + bitCount(high & ~(high << 1u | low >> 31u)));
    }
}
