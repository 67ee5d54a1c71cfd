#version 430
// Shows one map with its stored bytes: values are linearised here, so that sRGB coding gives them back. Black without a surface.
// VIEW: 0 normal, 1 occlusion, roughness and metalness, 2 emissive times its factor.
#include "common/color.glsl"
#include "common/materials.glsl"
#include "common/surface.glsl"
#include "passes/shade/maps.glsl"

layout(binding = UNIT_SURFACE) uniform usampler2D surface_words;
layout(location = 0) out vec4 picture;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int number = surface_material(texelFetch(surface_words, pixel, 0).x);
    if (number < 0) {
        picture = vec4(0.0);
        return;
    }
    Maps maps = read_maps(pixel);
#if VIEW == 0
    vec2 normal = maps.surface.NORMAL_COMPONENTS;
    vec2 xy = normal * 2.0 - 1.0;
    float z = sqrt(max(1.0 - dot(xy, xy), 0.0));
    picture = vec4(srgb_to_linear(vec3(normal, z * 0.5 + 0.5)), 1.0);
#elif VIEW == 1
    picture = vec4(srgb_to_linear(vec3(maps.emission.OCCLUSION_COMPONENTS, maps.surface.ROUGHNESS_COMPONENTS, maps.surface.METALNESS_COMPONENTS)), 1.0);
#else
    picture = vec4(clamp(maps.emission.EMISSIVE_COMPONENTS * materials[number].emissive.rgb, 0.0, 1.0), 1.0);
#endif
}
