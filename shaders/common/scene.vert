#version 430
// Vertices of the scene. The visibility pass and the forward path share this shader, so that their depths agree bit for bit.
invariant gl_Position;

layout(location = 0) in vec3 position;
layout(location = 1) in vec2 texture_coordinate;
#if VERTEX_COLORS
layout(location = 2) in vec4 vertex_color;
#endif
// Per instance: rows of the local-to-world matrix, and texture and material id as the visibility buffer stores them.
layout(location = 3) in vec4 transform_x;
layout(location = 4) in vec4 transform_y;
layout(location = 5) in vec4 transform_z;
layout(location = 6) in uint instance_ids;
// Height over width of the image that the instance's material shows.
layout(location = 7) in float instance_aspect;

uniform mat4 view_projection;

// u, v, and v times the aspect: two outputs instead of four make triangles cheaper to set up on a software renderer.
out vec3 place;
#if VERTEX_COLORS
out vec4 color;
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
    ids = instance_ids;
}
