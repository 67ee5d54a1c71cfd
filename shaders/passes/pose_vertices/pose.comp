#version 430
// Moves the vertices of one primitive: first by morph targets, then by the joints of its skin (glTF 2.0, Sec. 3.7.2.2 and 3.7.3).
#include "generated/pose.glsl"
#include "common/work_groups.glsl"
layout(local_size_x = POSE_GROUP) in;

layout(std430, binding = BINDING_REST) readonly buffer Rest { float rest[]; };
layout(std430, binding = BINDING_TARGETS) readonly buffer Targets { float targets[]; };
layout(std430, binding = BINDING_INFLUENCES) readonly buffer Influences { uvec2 influences[]; };
// Rows of the joints' matrices, then the weights of the morph targets.
layout(std430, binding = BINDING_POSE) readonly buffer Pose { float pose[]; };
layout(std430, binding = BINDING_VERTICES) buffer Vertices { float vertices[]; };
layout(std430, binding = BINDING_NORMALS) buffer Normals { float normals[]; };
layout(std430, binding = BINDING_TANGENTS) buffer Tangents { float tangents[]; };

uniform int vertex_count;
uniform int base_vertex;
uniform int vertex_floats;    // floats of a vertex in `vertices`; the first are its position
uniform int target_count;
uniform int influence_count;
uniform int joint_count;
uniform bool has_normals;
uniform bool has_tangents;

vec3 rest_at(int place) {
    return vec3(rest[place], rest[place + 1], rest[place + 2]);
}

vec3 target_at(int place) {
    return vec3(targets[place], targets[place + 1], targets[place + 2]);
}

vec4 pose_row(int place) {
    return vec4(pose[place], pose[place + 1], pose[place + 2], pose[place + 3]);
}

// Normalises a vector; zero if it has no direction.
vec3 directed(vec3 vector) {
    float largest = max(max(abs(vector.x), abs(vector.y)), abs(vector.z));
    // Scaled first, because squares of large numbers overflow. Comparisons with NaN are false.
    bool has_direction = largest >= 1e-6 && largest < 3e38;
    return has_direction ? normalize(vector / largest) : vec3(0.0);
}

float finite(float value) {
    return abs(value) < 3.402823e38 ? value : 0.0;
}

void main() {
    int vertex = int(work_group_number()) * POSE_GROUP + int(gl_LocalInvocationID.x);
    if (vertex >= vertex_count) return;
    int place = vertex * REST_FLOATS;
    vec3 position = rest_at(place);
    vec3 normal = rest_at(place + 3);
    vec3 tangent = rest_at(place + 6);
    float tangent_sign = rest[place + 9];
    for (int number = 0; number < target_count; ++number) {
        float weight = pose[JOINT_FLOATS * joint_count + number];
        if (weight == 0.0) continue;
        int offset = (number * vertex_count + vertex) * TARGET_FLOATS;
        position += weight * target_at(offset);
        normal += weight * target_at(offset + 3);
        tangent += weight * target_at(offset + 6);
    }
    if (influence_count > 0) {
        vec4 x = vec4(0.0), y = vec4(0.0), z = vec4(0.0);
        for (int number = 0; number < influence_count; ++number) {
            uvec2 influence = influences[vertex * influence_count + number];
            float share = uintBitsToFloat(influence.y);
            if (share == 0.0) continue;
            int row = int(influence.x) * JOINT_FLOATS;
            x += share * pose_row(row);
            y += share * pose_row(row + 4);
            z += share * pose_row(row + 8);
        }
        vec4 point = vec4(position, 1.0);
        position = vec3(dot(x, point), dot(y, point), dot(z, point));
        // Normals are transformed by the cofactor matrix, which needs no inverse.
        normal = vec3(dot(cross(y.xyz, z.xyz), normal), dot(cross(z.xyz, x.xyz), normal), dot(cross(x.xyz, y.xyz), normal));
        tangent = vec3(dot(x.xyz, tangent), dot(y.xyz, tangent), dot(z.xyz, tangent));
    }
    int row = base_vertex + vertex;
    vertices[row * vertex_floats] = finite(position.x);
    vertices[row * vertex_floats + 1] = finite(position.y);
    vertices[row * vertex_floats + 2] = finite(position.z);
    if (has_normals) {
        normal = directed(normal);
        for (int axis = 0; axis < 3; ++axis) normals[row * 3 + axis] = normal[axis];
    }
    if (has_tangents) {
        tangent = directed(tangent);
        bool has_direction = tangent != vec3(0.0) && tangent_sign != 0.0;
        for (int axis = 0; axis < 3; ++axis) tangents[row * 4 + axis] = has_direction ? tangent[axis] : 0.0;
        tangents[row * 4 + 3] = has_direction ? (tangent_sign < 0.0 ? -1.0 : 1.0) : 0.0;
    }
}
