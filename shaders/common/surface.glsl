// What is seen at a pixel, and its two words of storage in the visibility buffer. Nothing else reads or writes that storage.
#include "generated/layout.glsl"

struct Surface {
    int texture_id;      // -1: the material has no texture
    int material;        // -1: background
    vec2 uv;             // not wrapped
    vec2 gradient_x;     // change of uv from this pixel to the next on the right
    vec2 gradient_y;     // change of uv to the next pixel above
    vec3 color;          // linear vertex colour, 1 without
};

uint pack_color(vec3 color) {
    // Square root before 10 bits a channel: steps of about equal visibility.
    uvec3 bits = uvec3(sqrt(clamp(color, 0.0, 1.0)) * 1023.0 + 0.5);
    return bits.r | (bits.g << 10) | (bits.b << 20);
}

vec3 unpack_color(uint bits) {
    vec3 root = vec3(bits & 1023u, (bits >> 10) & 1023u, (bits >> 20) & 1023u) / 1023.0;
    return root * root;
}

uint pack_gradient(vec2 gradient) {
    return packHalf2x16(clamp(gradient * GRADIENT_SCALE, -65504.0, 65504.0));
}

void pack_surface(Surface surface, out uvec4 first, out uvec2 second) {
    uint ids = uint(surface.texture_id + 1) | (uint(surface.material + 1) << MATERIAL_SHIFT);
    first = uvec4(ids, floatBitsToUint(surface.uv), pack_gradient(surface.gradient_x));
    second = uvec2(pack_gradient(surface.gradient_y), pack_color(surface.color));
}

Surface unpack_surface(uvec4 first, uvec2 second) {
    Surface surface;
    surface.texture_id = int(first.x & ((1u << MATERIAL_SHIFT) - 1u)) - 1;
    surface.material = int(first.x >> MATERIAL_SHIFT) - 1;
    surface.uv = uintBitsToFloat(first.yz);
    surface.gradient_x = unpackHalf2x16(first.w) / GRADIENT_SCALE;
    surface.gradient_y = unpackHalf2x16(second.x) / GRADIENT_SCALE;
    surface.color = unpack_color(second.y);
    return surface;
}

// Level of detail for a texture of `size` texels: log2 of the longer side of the pixel's footprint.
float surface_lod(Surface surface, vec2 size) {
    vec2 x = surface.gradient_x * size;
    vec2 y = surface.gradient_y * size;
    return 0.5 * log2(max(max(dot(x, x), dot(y, y)), 1e-20));
}
