#version 430
// Decodes in the material's fragment shader, for fragments at the depth of the visible surface.
#include "common/visibility.glsl"
#include "ntc/albedo.glsl"

in vec3 place;
#if VERTEX_COLORS
in vec4 color;
#else
const vec4 color = vec4(1.0);
#endif
flat in uint ids;

layout(location = 0) out vec4 albedo;

void main() {
    // Two surfaces may have the same depth, and alpha may have cut out parts of one: the visibility buffer decides.
    if (texelFetch(surface_words, ivec2(gl_FragCoord.xy), 0).x != ids) discard;
    float footprint = pixel_footprint(dFdx(place).xz, dFdy(place).xz);
#if VERTEX_COLORS
    // Rounded as in the visibility buffer, so that all paths give the same colour.
    vec3 rounded = unpack_color(pack_color(color.rgb));
#else
    vec3 rounded = vec3(1.0);
#endif
    Surface surface = unpack_surface(pack_surface(ids, place.xy, footprint), rounded);
    albedo = vec4(decoded_albedo(surface, ivec2(gl_FragCoord.xy)), 1.0);
}
