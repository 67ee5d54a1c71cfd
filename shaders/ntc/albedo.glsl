// Linear albedo of a surface: the texel to decode for it, and the colour that the decoded texel gives.
#include "common/color.glsl"
#include "common/materials.glsl"
#include "common/surface.glsl"
#include "ntc/lookup.glsl"

struct WantedTexel {
    vec3 factor;       // linear, multiplies the texture's colour; the albedo where there is no texture
    int texture_id;    // -1: nothing is decoded
    vec2 uv;
    float lod;
    ivec2 wrap;        // WRAP_ codes
};

// Changes `uv` and `lod` to those that a filter other than trilinear reads (glTF sampler, OpenGL 4.3 Sec. 8.14).
void apply_sampler(inout vec2 uv, inout float lod, int flags, vec2 size, int last_level) {
    if (flags == 0) return;
    bool magnified = lod <= 0.0;
    if ((flags & SAMPLER_MIPMAP_NONE) != 0) lod = 0.0;
    if ((flags & SAMPLER_MIPMAP_NEAREST) != 0) lod = clamp(ceil(lod + 0.5) - 1.0, 0.0, float(last_level));
    bool nearest = (flags & (magnified ? SAMPLER_MAGNIFY_NEAREST : SAMPLER_MINIFY_NEAREST)) != 0;
    vec2 texels = max(floor(size * exp2(-floor(max(lod, 0.0)))), 1.0);
    if (nearest) uv = (floor(uv * texels) + 0.5) / texels;
}

// Decoder of a surface; -1 for the background, and for materials without a texture or whose texture is not in the pack.
int surface_decoder(Surface surface) {
    return surface.material >= 0 && surface.texture_id >= 0 ? textures[surface.texture_id].decoder : -1;
}

WantedTexel wanted_texel(Surface surface) {
    MaterialRecord material = materials[max(surface.material, 0)];
    WantedTexel wanted;
    wanted.factor = surface.material >= 0 ? material.factor.rgb * surface.color : vec3(0.0);
    wanted.texture_id = surface_decoder(surface) >= 0 ? surface.texture_id : -1;
    wanted.uv = surface.uv;
    wanted.lod = 0.0;
    PlaneRecord plane = material.planes[PLANE_BASE];
    wanted.wrap = ivec2(plane.wrap_u, plane.wrap_v);
    if (wanted.texture_id >= 0) {
        LevelRecord finest = levels[textures[wanted.texture_id].first_level];
        vec2 size = vec2(finest.texel_width, finest.texel_height);
        wanted.lod = footprint_lod(surface.footprint, size.x);
        apply_sampler(wanted.uv, wanted.lod, plane.sampler_flags, size, textures[wanted.texture_id].levels - 1);
    }
    return wanted;
}

vec3 shown_albedo(WantedTexel wanted, vec4 decoded) {
    if (wanted.texture_id < 0) return wanted.factor;
    vec3 rgb = textures[wanted.texture_id].channels < 3 ? decoded.rrr : decoded.rgb;
    return wanted.factor * (textures[wanted.texture_id].srgb != 0 ? srgb_to_linear(rgb) : rgb);
}

vec3 decoded_albedo(Surface surface, ivec2 pixel) {
    WantedTexel wanted = wanted_texel(surface);
    vec4 decoded = vec4(0.0);
    if (wanted.texture_id >= 0) {
        TextureRecord record = textures[wanted.texture_id];
        Lookup lookup = lookup_of(record, wanted.uv, wanted.lod, wanted.wrap, pixel);
        decoded = decode_at(record, lookup.at, lookup.lod, wanted.wrap, true);
    }
    return shown_albedo(wanted, decoded);
}
