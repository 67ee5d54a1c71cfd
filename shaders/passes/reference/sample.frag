#version 430
// Samples the images of one texture array of a plane of maps: originals, or images that path `on-load` has compressed.
// FIRST 1: the pass of the first array. It also colours untextured surfaces and the background.
// SORTS 1: with FIRST, writes the array that each remaining pixel needs as its depth. The pass of each further array then draws only the
// pixels with its depth.
// LOADED 1: images of path `on-load`. A plane's components are in PARTS textures; each has 0 in place of the other's components.
#include "common/planes.glsl"
#include "common/visibility.glsl"
#include "common/wrap.glsl"

#if !FIRST
layout(early_fragment_tests) in;
#endif
layout(binding = UNIT_IMAGES) uniform sampler2DArray images;
#if PARTS > 1
layout(binding = UNIT_SECOND_IMAGES) uniform sampler2DArray second_images;
#endif
uniform int first_array;
// WRAP_ codes of all images of the array. A uniform costs less than a record.
uniform ivec2 wrap;
layout(location = 0) out vec4 target;

// Place and components of an image.
struct Image {
    int array;         // -1: not yet loaded
    int layer;
    int components;    // a bit for each component that it holds
    int finest;        // finest mip that is loaded
};
#if LOADED
layout(std430, binding = BINDING_RESULTS) readonly buffer Places {
    ivec4 material_places[];
};

Image image_of(int material) {
    ivec4 place = material_places[material];
    return Image(place.x, place.y, place.z & materials[material].planes[PLANE].components, place.w);
}
#else
Image image_of(int material) {
    PlaneRecord plane = materials[material].planes[PLANE];
    return Image(plane.image_array, plane.image_layer, plane.components, 0);
}
#endif

vec4 sample_lod(vec3 at, float lod) {
    vec4 texel = textureLod(images, at, lod);
#if PARTS > 1
    texel += textureLod(second_images, at, lod);
#endif
    return texel;
}

vec4 sample_gradients(vec3 at, vec4 gradients) {
    vec4 texel = textureGrad(images, at, gradients.xy, gradients.zw);
#if PARTS > 1
    texel += textureGrad(second_images, at, gradients.xy, gradients.zw);
#endif
    return texel;
}

void main() {
    Surface surface = read_surface(ivec2(gl_FragCoord.xy));
    int material = max(surface.material, 0);
    PlaneRecord plane = materials[material].planes[PLANE];
    Image image = image_of(material);
    vec3 place = place_on_plane(plane, surface);
    // Mirroring is done here. For `repeat`, wrapping only drops the integer part.
    vec2 uv = vec2(wrap_coordinate(place.x, wrap.x), wrap_coordinate(place.y, wrap.y));
    vec3 at = vec3(uv, float(image.layer));
    float lod = footprint_lod(place.z, float(textureSize(images, 0).x));
#if LOADED
    // Finer mips are not yet loaded.
    if (image.finest > 0) lod = max(lod, float(image.finest));
#endif
#if GRADIENTS
    vec4 gradients = texelFetch(surface_gradients, ivec2(gl_FragCoord.xy), 0);
    gradients = vec4(plane_uv_step(plane, gradients.xy), plane_uv_step(plane, gradients.zw));
    vec4 texel = sample_gradients(at, gradients);
#if SECOND_UVS
    // Of the second UV set, only the footprint is known.
    if (plane.second_uvs != 0) texel = sample_lod(at, lod);
#endif
#if LOADED
    if (image.finest > 0) texel = sample_lod(at, lod);
#endif
#else
    vec4 texel = sample_lod(at, lod);
#endif
#if FIRST
    // Without an array, the image is not yet loaded.
    bool textured = surface.material >= 0 && plane.texture_id >= 0 && image.array >= 0;
    target = plane_content(surface, textured ? image.components : 0, texel);
#if SORTS
    gl_FragDepth = textured && image.array != first_array ? float(image.array + 1) / BUCKET_DEPTHS : 0.0;
#endif
#else
    target = plane_content(surface, image.components, texel);
#endif
}
