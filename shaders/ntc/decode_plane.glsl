// Decoding of one plane of a surface's maps.
#include "ntc/plane.glsl"
#include "ntc/decode.glsl"

// Place at which a pixel's texture is decoded: the place of the exact filter, or the texel that the stochastic filter chose.
struct Lookup {
    uvec2 at;      // wrapped, in units of 2^-32
    float lod;
};

#if FILTER_STOCHASTIC
#include "common/noise.glsl"

uniform int sample_number;

// Stochastic filter: chooses one of the eight texels of a trilinear lookup, with its weight as probability. The weight is a product of those of
// mip, column and row, so three choices between two options suffice; one threshold serves all three (common/noise.glsl).
// Derivation and measurements: docs/explanation/filtering.md#stochastic-filter.
Lookup lookup_of(TextureRecord record, vec2 uv, float lod, ivec2 wrap, ivec2 pixel) {
    uint threshold = filter_threshold(uvec2(pixel), uint(sample_number));
    uint range = 0u;
    lod = present_lod(record, lod);
    int number = int(floor(lod));
    if (second_taken(threshold, range, uint((lod - float(number)) * 4294967296.0))) ++number;
    LevelRecord level = levels[record.first_level + number];
    uvec2 at = fixed_coordinates(uv, wrap);
    Footprint footprint = footprint_at(level, at, wrap);
    bool right = second_taken(threshold, range, second_share(at.x, level.texel_width));
    bool below = second_taken(threshold, range, second_share(at.y, level.texel_height));
    int x = right ? footprint.second.x : footprint.first.x;
    int y = below ? footprint.second.y : footprint.first.y;
    return Lookup(uvec2(texel_centre(x, level.texel_width), texel_centre(y, level.texel_height)), float(number));
}
#else
Lookup lookup_of(TextureRecord record, vec2 uv, float lod, ivec2 wrap, ivec2 pixel) {
    return Lookup(fixed_coordinates(uv, wrap), lod);
}
#endif

vec4 decoded_plane(Surface surface, ivec2 pixel) {
    WantedTexel wanted = wanted_texel(surface);
    vec4 decoded = vec4(0.0);
    if (wanted.texture_id >= 0) {
        TextureRecord record = textures[wanted.texture_id];
        Lookup lookup = lookup_of(record, wanted.uv, wanted.lod, wanted.wrap, pixel);
        decoded = decode_at(record, lookup.at, lookup.lod, wanted.wrap, true);
    }
    return shown_plane(surface, wanted.texture_id, wanted.components, decoded);
}

#if DECODES_TOGETHER && PIXELS_TOGETHER
#include "generated/together.glsl"

// Does the same as `decoded_plane`, for all invocations of a work group together. `inside`: whether this one has a pixel.
vec4 decoded_plane_together(Surface surface, ivec2 pixel, bool inside) {
    WantedTexel wanted = wanted_texel(surface);
    bool decodes = inside && wanted.texture_id >= 0;
    int texture_id = max(wanted.texture_id, 0);
    Lookup lookup = Lookup(uvec2(0u), 0.0);
    if (decodes) lookup = lookup_of(textures[texture_id], wanted.uv, wanted.lod, wanted.wrap, pixel);
    int lane = int(gl_LocalInvocationIndex);
    vec4 decoded = decode_together(lane, decodes, texture_id, lookup.at, lookup.lod, wanted.wrap);
    return shown_plane(surface, wanted.texture_id, wanted.components, wanted.texture_id >= 0 ? decoded : vec4(0.0));
}
#endif
