#version 430
// Writes the visibility buffer (docs/explanation/decode-paths.md#visibility-buffer). Nothing is shaded, so hidden surfaces cost a depth
// test only.
#include "common/frame.glsl"
#include "common/materials.glsl"
#include "common/noise.glsl"
#include "common/surface.glsl"
#include "common/wrap.glsl"

in vec3 place;
#if VERTEX_COLORS
in vec4 color;
#else
const vec4 color = vec4(1.0);
#endif
flat in uint ids;

layout(location = 0) out uvec4 words;
#if VERTEX_COLORS
layout(location = OUTPUT_SURFACE_COLOR) out uint packed_color;
#endif
#if GRADIENTS
layout(location = OUTPUT_SURFACE_GRADIENTS) out vec4 gradients;
#endif
#if SECOND_UVS
in vec2 second_place;
layout(location = OUTPUT_SURFACE_SECOND_UVS) out vec4 second_uvs;
#endif
#if FRAME
in vec3 world_position;
in vec3 world_normal;
in vec4 world_tangent;
layout(location = OUTPUT_SURFACE_FRAME) out uvec2 frame_words;

bool is_direction(vec3 vector) {
    float length_squared = dot(vector, vector);
    // False for NaN, too.
    return length_squared > 1e-20 && length_squared < 1e30;
}

// Frame of the surface: normal and tangent from the file, or else from the triangle and its uv.
// On the back of a surface, all three axes are reversed.
Frame surface_frame() {
    float facing = gl_FrontFacing ? 1.0 : -1.0;
    vec3 step_x = dFdx(world_position);
    vec3 step_y = dFdy(world_position);
    // This normal faces the eye, because the steps are along the picture's right and up.
    vec3 normal = cross(step_x, step_y);
    normal = is_direction(normal) ? normalize(normal) : vec3(0.0, 1.0, 0.0);
    if (is_direction(world_normal)) normal = normalize(world_normal) * facing;

    PlaneRecord plane = materials[surface_material(ids)].planes[PLANE_SURFACE];
    // Derivatives of inputs, not of values from a buffer: helper invocations outside the triangle may read anything there.
    vec2 uv_x = dFdx(place.xy);
    vec2 uv_y = dFdy(place.xy);
#if SECOND_UVS
    vec2 second_x = dFdx(second_place);
    vec2 second_y = dFdy(second_place);
    if (plane.second_uvs != 0) {
        uv_x = second_x;
        uv_y = second_y;
    }
#endif
    uv_x = plane_uv_step(plane, uv_x);
    uv_y = plane_uv_step(plane, uv_y);
    float turn = uv_x.x * uv_y.y < uv_y.x * uv_x.y ? -facing : facing;
    vec3 tangent = turn * (step_x * uv_y.y - step_y * uv_x.y);
    vec3 along_v = turn * (step_y * uv_x.x - step_x * uv_y.x);
    float handedness = dot(cross(normal, tangent), along_v) > 0.0 ? -1.0 : 1.0;
    if (is_direction(world_tangent.xyz)) {
        tangent = world_tangent.xyz * facing;
        handedness = world_tangent.w < 0.0 ? -facing : facing;
    }
    if (!is_direction(tangent)) tangent = vec3(1.0, 0.0, 0.0);
    tangent = normalize(tangent);
    tangent -= normal * dot(normal, tangent);
    if (dot(tangent, tangent) < 1e-6) tangent = cross(normal, abs(normal.x) < 0.9 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0));
    return Frame(normal, normalize(tangent), handedness);
}
#endif

#if ALPHA_TEST
layout(binding = UNIT_ALPHA) uniform sampler2D alpha_texture;

uniform uint blend_sample;   // 0 to 15

// Layer of a fragment at `place` (gl_FragCoord), as a cell of depth: 2^-12 of the distance in perspective, and of the clip range. Drivers
// round depths differently, which changes few cells.
uint layer_at(vec4 place) {
    return hash(uint(place.z * 4096.0)) + (floatBitsToUint(place.w) >> 11u);
}
#endif

void main() {
    vec2 uv = place.xy;
    vec3 step_x = dFdx(place);
    vec3 step_y = dFdy(place);
    // Derivatives come before `discard`, because they need all four pixels of a quad.
#if SECOND_UVS
    second_uvs = vec4(second_place, pixel_footprint(dFdx(second_place), dFdy(second_place)), 0.0);
#endif
#if FRAME
    frame_words = pack_frame(surface_frame());
#endif
#if ALPHA_TEST
    MaterialRecord material = materials[surface_material(ids)];
    PlaneRecord base = materials[surface_material(ids)].planes[PLANE_BASE];
    vec2 at = vec2(wrap_coordinate(uv.x, base.wrap_u), wrap_coordinate(uv.y, base.wrap_v));
    float alpha = material.factor.a * color.a * textureGrad(alpha_texture, at, step_x.xy, step_y.xy).r;
    // Alpha hashing: a blended surface covers a share of the pixels that equals its alpha (docs/explanation/filtering.md#blend-surfaces).
    uint threshold = blend_threshold(uvec2(gl_FragCoord.xy), layer_at(gl_FragCoord), blend_sample);
    if (material.alpha_mode == ALPHA_BLEND ? !is_covered(alpha, threshold) : alpha < material.alpha_cutoff) discard;
#endif
    words = pack_surface(ids, uv, pixel_footprint(step_x.xz, step_y.xz));
#if VERTEX_COLORS
    packed_color = pack_color(color.rgb);
#endif
#if GRADIENTS
    gradients = vec4(step_x.xy, step_y.xy);
#endif
}
