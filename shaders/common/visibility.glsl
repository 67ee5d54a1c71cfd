// Reading the visibility buffer.
#include "common/frame.glsl"
#include "common/surface.glsl"

// 1: the visibility buffer holds normals and tangents.
#ifndef FRAME
#define FRAME 0
#endif

layout(binding = UNIT_SURFACE) uniform usampler2D surface_words;
#if VERTEX_COLORS
layout(binding = UNIT_SURFACE_COLOR) uniform usampler2D surface_colors;
#endif
#if GRADIENTS
layout(binding = UNIT_SURFACE_GRADIENTS) uniform sampler2D surface_gradients;
#endif
#if SECOND_UVS
layout(binding = UNIT_SURFACE_SECOND_UVS) uniform sampler2D surface_second_uvs;
#endif

Surface read_surface(ivec2 pixel) {
#if VERTEX_COLORS
    vec3 color = unpack_color(texelFetch(surface_colors, pixel, 0).x);
#else
    vec3 color = vec3(1.0);
#endif
    Surface surface = unpack_surface(texelFetch(surface_words, pixel, 0), color);
#if SECOND_UVS
    surface.second_uv = texelFetch(surface_second_uvs, pixel, 0).xyz;
#endif
    return surface;
}

#if FRAME
layout(binding = UNIT_SURFACE_FRAME) uniform usampler2D surface_frames;
#endif
