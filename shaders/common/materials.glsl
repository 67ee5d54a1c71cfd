// The scene's materials.
#include "generated/layout.glsl"

layout(std430, binding = BINDING_MATERIALS) readonly buffer Materials {
    MaterialRecord materials[];
};

// Transforms a vertex's uv, of the plane's UV set, to the uv at which the plane's maps are read.
vec2 plane_uv(PlaneRecord plane, vec2 uv) {
    return vec2(dot(plane.uv_u.xy, uv) + plane.uv_u.z, dot(plane.uv_v.xy, uv) + plane.uv_v.z);
}

// Transforms a step of the vertex's uv to a step of that uv.
vec2 plane_uv_step(PlaneRecord plane, vec2 uv_step) {
    return vec2(dot(plane.uv_u.xy, uv_step), dot(plane.uv_v.xy, uv_step));
}
