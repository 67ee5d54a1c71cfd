#version 430
// Decodes in the material's own fragment shader, where the depth test passes for the surface that is seen.
#include "common/visibility.glsl"
#include "ntc/albedo.glsl"

in vec2 uv;
in vec4 color;
flat in int material_index;

layout(location = 0) out vec4 albedo;

void main() {
    int texture_id = materials[material_index].texture_id;
    Surface surface = Surface(texture_id, material_index, uv, dFdx(uv), dFdy(uv), color.rgb);
    uvec4 first;
    uvec2 second;
    pack_surface(surface, first, second);
    // Two surfaces may share a depth, and parts of one may have been cut out by alpha: the visibility buffer says whose pixel this is.
    if (texelFetch(surface_first, ivec2(gl_FragCoord.xy), 0).x != first.x) discard;
    // Through the same storage as the deferred path, so that both read the same footprint.
    albedo = vec4(decoded_albedo(unpack_surface(first, second)), 1.0);
}
