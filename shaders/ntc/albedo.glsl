// Linear albedo of a surface, decoded.
#include "common/color.glsl"
#include "common/materials.glsl"
#include "common/surface.glsl"
#include "ntc/decode.glsl"

// Moves `uv` and `lod` to where a filter that is not trilinear reads (glTF sampler, OpenGL 4.3 Sec. 8.14).
void apply_sampler(inout vec2 uv, inout float lod, int flags, vec2 size, int last_level) {
    if (flags == 0) return;
    bool magnified = lod <= 0.0;
    if ((flags & SAMPLER_MIPMAP_NONE) != 0) lod = 0.0;
    if ((flags & SAMPLER_MIPMAP_NEAREST) != 0) lod = clamp(ceil(lod + 0.5) - 1.0, 0.0, float(last_level));
    bool nearest = (flags & (magnified ? SAMPLER_MAGNIFY_NEAREST : SAMPLER_MINIFY_NEAREST)) != 0;
    vec2 texels = max(floor(size * exp2(-floor(max(lod, 0.0)))), 1.0);
    if (nearest) uv = (floor(uv * texels) + 0.5) / texels;
}

// Materials without a texture, and those whose texture the pack does not hold, show their factor.
vec3 decoded_albedo(Surface surface) {
    MaterialRecord material = materials[max(surface.material, 0)];
    vec3 albedo = material.factor.rgb * surface.color;
    TextureRecord record = textures[max(surface.texture_id, 0)];
    bool wanted = surface.material >= 0 && surface.texture_id >= 0 && record.decoder >= 0;
    if (wanted) {
        LevelRecord finest = levels[record.first_level];
        vec2 size = vec2(finest.texel_width, finest.texel_height);
        vec2 uv = surface.uv;
        float lod = surface_lod(surface, size.x);
        apply_sampler(uv, lod, material.sampler_flags, size, record.levels - 1);
        vec4 decoded = decode_texture(record, uv, lod, ivec2(material.wrap_u, material.wrap_v), wanted);
        vec3 rgb = record.channels < 3 ? decoded.rrr : decoded.rgb;
        albedo *= record.srgb != 0 ? srgb_to_linear(rgb) : rgb;
    }
    return surface.material >= 0 ? albedo : vec3(0.0);
}
