// A visible surface, and its encoding in the visibility buffer. Only this file knows the encoding.
#include "generated/layout.glsl"

// 1: the scene has vertex colours.
#ifndef VERTEX_COLORS
#define VERTEX_COLORS 0
#endif
// 1: the visibility buffer holds gradients of uv, for anisotropic filters.
#ifndef GRADIENTS
#define GRADIENTS 0
#endif

// 1: some maps use a second UV set.
#ifndef SECOND_UVS
#define SECOND_UVS 0
#endif

struct Surface {
    int texture_id;      // -1: the material has no texture
    int material;        // -1: background
    vec2 uv;             // not wrapped
    float footprint;     // longer side of the pixel's footprint, in widths of the texture's image
    vec3 color;          // linear vertex colour, 1 without
#if SECOND_UVS
    vec3 second_uv;      // xy: second UV set; z: the footprint there
#endif
};

uint pack_color(vec3 color) {
    // Square roots in 10 bits per channel make steps about equally visible.
    uvec3 bits = uvec3(sqrt(clamp(color, 0.0, 1.0)) * 1023.0 + 0.5);
    return bits.r | (bits.g << 10) | (bits.b << 20);
}

vec3 unpack_color(uint bits) {
    vec3 root = vec3(bits & 1023u, (bits >> 10) & 1023u, (bits >> 20) & 1023u) / 1023.0;
    return root * root;
}

// Longer side of a pixel's footprint: the larger change of uv to the next pixel on the right or above, in widths of the image.
float pixel_footprint(vec2 gradient_x, vec2 gradient_y) {
    return sqrt(max(dot(gradient_x, gradient_x), dot(gradient_y, gradient_y)));
}

int surface_texture(uint ids) {
    return int(ids & ((1u << MATERIAL_SHIFT) - 1u)) - 1;
}

int surface_material(uint ids) {
    return int(ids >> MATERIAL_SHIFT) - 1;
}

// `ids` is the instance's word of texture and material id (SceneBuffers).
uvec4 pack_surface(uint ids, vec2 uv, float footprint) {
    return uvec4(ids, floatBitsToUint(uv), floatBitsToUint(footprint));
}

Surface unpack_surface(uvec4 words, vec3 color) {
    Surface surface;
    surface.texture_id = surface_texture(words.x);
    surface.material = surface_material(words.x);
    surface.uv = uintBitsToFloat(words.yz);
    surface.footprint = uintBitsToFloat(words.w);
    surface.color = color;
    return surface;
}

// Level of detail of a texture that is `width` texels wide: log2 of the footprint's longer side in texels.
float footprint_lod(float footprint, float width) {
    return log2(max(footprint * width, 1e-10));
}
