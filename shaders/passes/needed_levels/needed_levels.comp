#version 430
// Finds the finest mip of each texture that visible pixels read.
layout(local_size_x = 8, local_size_y = 8) in;
#include "common/visibility.glsl"
#include "ntc/plane.glsl"

layout(std430, binding = BINDING_RESULTS) buffer NeededLevels {
    int needed_levels[];
};

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, textureSize(surface_words, 0)))) return;
    WantedTexel wanted = wanted_texel(read_surface(pixel));
    if (wanted.texture_id < 0) return;
    float lod = is_finite(wanted.lod) ? wanted.lod : 0.0;
    int level = int(clamp(lod, 0.0, float(textures[wanted.texture_id].levels - 1)));
    if (level < needed_levels[wanted.texture_id]) atomicMin(needed_levels[wanted.texture_id], level);
}
