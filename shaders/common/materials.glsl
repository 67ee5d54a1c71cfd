// The scene's materials.
#include "generated/layout.glsl"

layout(std430, binding = BINDING_MATERIALS) readonly buffer Materials {
    MaterialRecord materials[];
};

// uv at which a plane's maps are read, from the vertex's uv of the UV set that the plane takes.
vec2 plane_uv(PlaneRecord plane, vec2 uv) {
    return vec2(dot(plane.uv_u.xy, uv) + plane.uv_u.z, dot(plane.uv_v.xy, uv) + plane.uv_v.z);
}

// Change of that uv for a step of the vertex's uv.
vec2 plane_uv_step(PlaneRecord plane, vec2 uv_step) {
    return vec2(dot(plane.uv_u.xy, uv_step), dot(plane.uv_v.xy, uv_step));
}
