#version 430
// Samples the original images of one texture array.
#include "common/materials.glsl"
#include "common/visibility.glsl"
#include "common/wrap.glsl"

layout(early_fragment_tests) in;
layout(binding = UNIT_IMAGES) uniform sampler2DArray images;
layout(location = 0) out vec4 albedo;

void main() {
    Surface surface = read_surface(ivec2(gl_FragCoord.xy));
    MaterialRecord material = materials[max(surface.material, 0)];
    // Folded here for mirrored wrap; where the sampler repeats, the coordinate only loses its whole turns.
    vec2 uv = vec2(wrap_coordinate(surface.uv.x, material.wrap_u), wrap_coordinate(surface.uv.y, material.wrap_v));
    vec3 at = vec3(uv, float(material.image_layer));
#if ANISOTROPIC
    vec3 texel = textureGrad(images, at, surface.gradient_x, surface.gradient_y).rgb;
#else
    vec3 texel = textureLod(images, at, surface_lod(surface, vec2(textureSize(images, 0).xy))).rgb;
#endif
    albedo = vec4(material.factor.rgb * surface.color * texel, 1.0);
}
