#version 430
// Decodes several planes of each visible pixel in one pass. Planes that read the same texels share one search for codes.
layout(local_size_x = 8, local_size_y = 8) in;
#define PIXELS_TOGETHER 1
#define ANY_PLANE 1
#define PLANE plane_number
int plane_number;
#include "common/visibility.glsl"
#include "ntc/decode_plane.glsl"

layout(rgba32f, binding = IMAGE_PLANES) uniform writeonly image2D targets[3];
uniform int planes;    // a bit for each plane to decode

shared uint other_planes;    // a bit for each plane of which a pixel reads other texels than of the first

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    int lane = int(gl_LocalInvocationIndex);
    ivec2 size = textureSize(surface_words, 0);
    bool inside = all(lessThan(pixel, size));
    Surface surface = read_surface(min(pixel, size - 1));
    int left = planes;
    // Each round decodes the first plane that is left, and those that read the same texels.
    while (left != 0) {
        int first_plane = findLSB(left);
        plane_number = first_plane;
        WantedTexel first = wanted_texel(surface);
        int first_texture = max(first.texture_id, 0);
        int alike = first_alike(surface);
        Lookup lookup = Lookup(uvec2(0u), 0.0);
        if (first.texture_id >= 0) lookup = lookup_of(textures[first_texture], first.uv, first.lod, first.wrap, pixel);
        codes_held = false;
        if (lane == 0) other_planes = 0u;
        barrier();
        for (int others = left; others != 0; others &= others - 1) {
            plane_number = findLSB(others);
            int texture_id = decoded_texture(surface);
            bool decodes = inside && texture_id >= 0;
            bool is_same = texture_id == first.texture_id && first_alike(surface) == alike;
            if (decodes && !is_same) atomicOr(other_planes, 1u << uint(plane_number));
            barrier();
            if ((other_planes >> uint(plane_number) & 1u) != 0u) continue;
            vec4 decoded = decode_together(lane, decodes, first_texture, lookup.at, lookup.lod, first.wrap);
            int components = 0;
            if (texture_id >= 0) components = wanted_components(materials[surface.material].planes[PLANE], texture_id);
            else decoded = vec4(0.0);
            vec4 shown = shown_plane(surface, texture_id, components, decoded);
            if (inside) imageStore(targets[plane_number], pixel, shown);
        }
        left = int(other_planes);
        barrier();
    }
}
