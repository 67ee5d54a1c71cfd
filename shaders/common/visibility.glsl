// Reading the visibility buffer.
#include "common/surface.glsl"

layout(binding = UNIT_SURFACE_FIRST) uniform usampler2D surface_first;
layout(binding = UNIT_SURFACE_SECOND) uniform usampler2D surface_second;

Surface read_surface(ivec2 pixel) {
    return unpack_surface(texelFetch(surface_first, pixel, 0), texelFetch(surface_second, pixel, 0).xy);
}
