#version 430
// Samples the original images of one texture array, which belongs to one plane of maps.
// FIRST 1: the pass of the first array; it also colours untextured surfaces and the background.
// SORTS 1: with FIRST, writes as depth which array each remaining pixel needs, so that the pass of each further array draws only
// its own pixels.
#include "common/planes.glsl"
#include "common/visibility.glsl"
#include "common/wrap.glsl"

#if !FIRST
layout(early_fragment_tests) in;
#endif
layout(binding = UNIT_IMAGES) uniform sampler2DArray images;
uniform int first_array;
// WRAP_ codes, the same for all images of an array: a uniform costs less than a record.
uniform ivec2 wrap;
layout(location = 0) out vec4 target;

void main() {
    Surface surface = read_surface(ivec2(gl_FragCoord.xy));
    PlaneRecord plane = materials[max(surface.material, 0)].planes[PLANE];
    vec3 place = place_on_plane(plane, surface);
    // Mirroring is done here; where the sampler repeats, the coordinate only loses its integer part.
    vec2 uv = vec2(wrap_coordinate(place.x, wrap.x), wrap_coordinate(place.y, wrap.y));
    vec3 at = vec3(uv, float(plane.image_layer));
#if GRADIENTS
    vec4 gradients = texelFetch(surface_gradients, ivec2(gl_FragCoord.xy), 0);
    gradients = vec4(plane_uv_step(plane, gradients.xy), plane_uv_step(plane, gradients.zw));
    vec4 texel = textureGrad(images, at, gradients.xy, gradients.zw);
#if SECOND_UVS
    // Only the footprint is known of the other UV set.
    if (plane.second_uvs != 0) texel = textureLod(images, at, footprint_lod(place.z, float(textureSize(images, 0).x)));
#endif
#else
    vec4 texel = textureLod(images, at, footprint_lod(place.z, float(textureSize(images, 0).x)));
#endif
#if FIRST
    // Without an array the image is still to come.
    bool textured = surface.material >= 0 && plane.texture_id >= 0 && plane.image_array >= 0;
    target = plane_content(surface, textured ? plane.components : 0, texel);
#if SORTS
    gl_FragDepth = textured && plane.image_array != first_array ? float(plane.image_array + 1) / BUCKET_DEPTHS : 0.0;
#endif
#else
    target = plane_content(surface, plane.components, texel);
#endif
}
