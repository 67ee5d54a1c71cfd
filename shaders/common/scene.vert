#version 430
// Vertices of the scene. The visibility pass and the forward path share this shader, so that their depths agree bit for bit.
#ifndef FRAME
#define FRAME 0
#endif
#ifndef SECOND_UVS
#define SECOND_UVS 0
#endif
invariant gl_Position;

layout(location = 0) in vec3 position;
layout(location = 1) in vec2 texture_coordinate;
#if VERTEX_COLORS
layout(location = 2) in vec4 vertex_color;
#endif
#if SECOND_UVS
layout(location = 8) in vec2 second_texture_coordinate;
#endif
#if FRAME
// 0 if the file has none.
layout(location = 9) in vec3 normal;
layout(location = 10) in vec4 tangent;
#endif
// Per instance: rows of the local-to-world matrix, and texture and material id as the visibility buffer stores them.
layout(location = 3) in vec4 transform_x;
layout(location = 4) in vec4 transform_y;
layout(location = 5) in vec4 transform_z;
layout(location = 6) in uint instance_ids;
// Height over width of the image that the instance's material shows.
layout(location = 7) in float instance_aspect;

uniform mat4 view_projection;

// u, v, and v times the aspect. Fewer outputs make triangles cheaper to set up on a software renderer.
out vec3 place;
#if VERTEX_COLORS
out vec4 color;
#endif
#if SECOND_UVS
out vec2 second_place;
#endif
#if FRAME
out vec3 world_position;
out vec3 world_normal;     // of any length
out vec4 world_tangent;    // of any length, and the sign of the bitangent
#endif
flat out uint ids;

void main() {
    vec4 local = vec4(position, 1.0);
    vec4 world = vec4(dot(transform_x, local), dot(transform_y, local), dot(transform_z, local), 1.0);
    gl_Position = view_projection * world;
    place = vec3(texture_coordinate, texture_coordinate.y * instance_aspect);
#if VERTEX_COLORS
    color = vertex_color;
#endif
#if SECOND_UVS
    second_place = second_texture_coordinate;
#endif
#if FRAME
    world_position = world.xyz;
    // Normals are transformed by the cofactor matrix: the transposed inverse times the determinant.
    vec3 cofactor_x = cross(transform_y.xyz, transform_z.xyz);
    vec3 cofactors = vec3(dot(cofactor_x, normal), dot(cross(transform_z.xyz, transform_x.xyz), normal),
                          dot(cross(transform_x.xyz, transform_y.xyz), normal));
    float mirrored = dot(transform_x.xyz, cofactor_x) < 0.0 ? -1.0 : 1.0;
    world_normal = mirrored * cofactors;
    world_tangent = vec4(
        dot(transform_x.xyz, tangent.xyz), dot(transform_y.xyz, tangent.xyz), dot(transform_z.xyz, tangent.xyz),
        mirrored * tangent.w
    );
#endif
    ids = instance_ids;
}
