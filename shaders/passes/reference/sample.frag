#version 430
// Samples the original images of one texture array.
// FIRST 1: the pass of the first array; it also colours untextured surfaces and the background.
// SORTS 1: with FIRST, writes as depth which array each remaining pixel needs, so that the pass of each further array draws only
// its own pixels.
#include "common/materials.glsl"
#include "common/visibility.glsl"
#include "common/wrap.glsl"

#if !FIRST
layout(early_fragment_tests) in;
#endif
layout(binding = UNIT_IMAGES) uniform sampler2DArray images;
uniform int first_array;
// WRAP_ codes, the same for all images of an array: a uniform costs less than a record.
uniform ivec2 wrap;
layout(location = 0) out vec4 albedo;

void main() {
    Surface surface = read_surface(ivec2(gl_FragCoord.xy));
    MaterialRecord material = materials[max(surface.material, 0)];
    PlaneRecord plane = material.planes[PLANE_BASE];
    // Mirroring is done here; where the sampler repeats, the coordinate only loses its integer part.
    vec2 uv = vec2(wrap_coordinate(surface.uv.x, wrap.x), wrap_coordinate(surface.uv.y, wrap.y));
    vec3 at = vec3(uv, float(plane.image_layer));
#if GRADIENTS
    vec4 gradients = texelFetch(surface_gradients, ivec2(gl_FragCoord.xy), 0);
    vec3 texel = textureGrad(images, at, gradients.xy, gradients.zw).rgb;
#else
    vec3 texel = textureLod(images, at, footprint_lod(surface.footprint, float(textureSize(images, 0).x))).rgb;
#endif
#if FIRST
    bool covered = surface.material >= 0;
    bool textured = covered && surface.texture_id >= 0;
    if (!textured) texel = vec3(1.0);
    albedo = covered ? vec4(material.factor.rgb * surface.color * texel, 1.0) : vec4(0.0);
#if SORTS
    gl_FragDepth = textured && plane.image_array != first_array ? float(plane.image_array + 1) / BUCKET_DEPTHS : 0.0;
#endif
#else
    albedo = vec4(material.factor.rgb * surface.color * texel, 1.0);
#endif
}
