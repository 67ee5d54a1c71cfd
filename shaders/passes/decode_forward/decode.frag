#version 430
// Decodes in the material's fragment shader, for fragments of the visible surface.
#include "common/visibility.glsl"
#include "ntc/decode_plane.glsl"

in vec3 place;
#if VERTEX_COLORS
in vec4 color;
#else
const vec4 color = vec4(1.0);
#endif
#if SECOND_UVS
in vec2 second_place;
#endif
flat in uint ids;

layout(location = 0) out vec4 target;

void main() {
    // Derivatives come before `discard`, because they need all four pixels of a quad.
    float footprint = pixel_footprint(dFdx(place).xz, dFdy(place).xz);
#if SECOND_UVS
    vec3 second_uv = vec3(second_place, pixel_footprint(dFdx(second_place), dFdy(second_place)));
#endif
    // Surfaces may have equal depths, and alpha may cut out parts of one. The visibility buffer says which is visible.
    if (texelFetch(surface_words, ivec2(gl_FragCoord.xy), 0).x != ids) discard;
#if VERTEX_COLORS
    // Rounded as in the visibility buffer, so that all paths give the same colour.
    vec3 rounded = unpack_color(pack_color(color.rgb));
#else
    vec3 rounded = vec3(1.0);
#endif
    Surface surface = unpack_surface(pack_surface(ids, place.xy, footprint), rounded);
#if SECOND_UVS
    surface.second_uv = second_uv;
#endif
    target = decoded_plane(surface, ivec2(gl_FragCoord.xy));
}
