// One plane of a surface's maps (ntc/codec/maps.py): which texel to decode, and how it enters the plane's target.
#include "common/color.glsl"
#include "common/numbers.glsl"
#include "common/planes.glsl"
#include "ntc/records.glsl"

struct WantedTexel {
    int components;    // a bit for each component to read; the others are neutral
    int texture_id;    // -1: nothing is decoded
    vec2 uv;
    float lod;
    ivec2 wrap;        // WRAP_ codes
};

// Applies a sampler that is not trilinear: moves `uv` to a texel's centre and `lod` to a whole level (OpenGL 4.3 Sec. 8.14).
void apply_sampler(inout vec2 uv, inout float lod, int flags, ivec2 size, int last_level) {
    if (flags == 0) return;
    bool magnified = lod <= 0.0;
    if ((flags & SAMPLER_MIPMAP_NONE) != 0) lod = 0.0;
    if ((flags & SAMPLER_MIPMAP_NEAREST) != 0) lod = clamp(ceil(lod + 0.5) - 1.0, 0.0, float(last_level));
    bool nearest = (flags & (magnified ? SAMPLER_MAGNIFY_NEAREST : SAMPLER_MINIFY_NEAREST)) != 0;
    // A shift, because exp2 of a whole number need not be exact.
    int level = is_finite(lod) ? int(clamp(floor(lod), 0.0, 31.0)) : 0;
    vec2 texels = vec2(max(size >> level, 1));
    if (nearest) uv = (floor(uv * texels) + 0.5) / texels;
}

// The texture of a surface in this plane; -1 for none, and for one that is not in the pack.
int decoded_texture(Surface surface) {
    if (surface.material < 0) return -1;
    int texture_id = materials[surface.material].planes[PLANE].texture_id;
    // The visibility buffer has the texture of the base colour.
    if (PLANE == PLANE_BASE && texture_id >= 0) texture_id = surface.texture_id;
    return texture_id >= 0 && textures[texture_id].decoder >= 0 ? texture_id : -1;
}

// Decoder of a surface; -1 for the background, and for materials without a texture or whose texture is not in the pack.
int surface_decoder(Surface surface) {
    int texture_id = decoded_texture(surface);
    return texture_id >= 0 ? textures[texture_id].decoder : -1;
}

// The first plane that reads the same texture at the same texels as this one.
int first_alike(Surface surface) {
    return (materials[max(surface.material, 0)].alike >> (2 * PLANE)) & 3;
}

// Components of this plane, as bits, that a material reads and the texture has.
int wanted_components(PlaneRecord plane, int texture_id) {
    return plane.components & (textures[texture_id].components >> (4 * PLANE));
}

WantedTexel wanted_texel(Surface surface) {
    int number = max(surface.material, 0);
    WantedTexel wanted;
    wanted.texture_id = decoded_texture(surface);
    PlaneRecord plane = materials[number].planes[PLANE];
    vec3 place = place_on_plane(plane, surface);
    wanted.uv = place.xy;
    wanted.lod = 0.0;
    wanted.wrap = ivec2(plane.wrap_u, plane.wrap_v);
    wanted.components = 0;
    if (wanted.texture_id >= 0) {
        wanted.components = wanted_components(plane, wanted.texture_id);
        LevelRecord finest = levels[textures[wanted.texture_id].first_level];
        ivec2 size = ivec2(finest.texel_width, finest.texel_height);
        wanted.lod = footprint_lod(place.z, float(size.x));
        apply_sampler(wanted.uv, wanted.lod, plane.sampler_flags, size, textures[wanted.texture_id].levels - 1);
    }
    return wanted;
}

// Converts a decoded texel to linear light.
vec4 linear_texel(int texture_id, vec4 decoded) {
    bool is_base = PLANE == PLANE_BASE;
    vec3 rgb = is_base && textures[texture_id].channels < 3 ? decoded.rrr : decoded.rgb;
    if (PLANE == PLANE_EMISSION || (is_base && textures[texture_id].srgb != 0)) rgb = srgb_to_linear(rgb);
    return vec4(rgb, is_base ? 1.0 : decoded.a);
}

// Content of the plane's target for a decoded texel.
vec4 shown_plane(Surface surface, int texture_id, int components, vec4 decoded) {
    return plane_content(surface, components, linear_texel(max(texture_id, 0), decoded));
}
