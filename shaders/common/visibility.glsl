// Reading the visibility buffer.
#include "common/surface.glsl"

layout(binding = UNIT_SURFACE) uniform usampler2D surface_words;
#if VERTEX_COLORS
layout(binding = UNIT_SURFACE_COLOR) uniform usampler2D surface_colors;
#endif
#if GRADIENTS
layout(binding = UNIT_SURFACE_GRADIENTS) uniform sampler2D surface_gradients;
#endif

Surface read_surface(ivec2 pixel) {
#if VERTEX_COLORS
    vec3 color = unpack_color(texelFetch(surface_colors, pixel, 0).x);
#else
    vec3 color = vec3(1.0);
#endif
    return unpack_surface(texelFetch(surface_words, pixel, 0), color);
}
