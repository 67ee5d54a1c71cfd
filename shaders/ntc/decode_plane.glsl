// Decoding a plane of a surface's maps.
#include "ntc/plane.glsl"
#include "ntc/decode.glsl"

// Place at which a pixel's texture is decoded: that of the exact filter, or the texel that the stochastic filter takes.
struct Lookup {
    uvec2 at;      // wrapped, in units of 2^-32
    float lod;
};

#if FILTER_STOCHASTIC
uniform int sample_number;

// Threshold of a sample of a pixel, in [0, 1): interleaved gradient noise (Jimenez 2014), so that neighbouring pixels differ most; from sample
// to sample it moves by the golden ratio, so that each texel is taken about as often as its weight says.
float filter_threshold(ivec2 pixel) {
    float noise = fract(52.9829189 * fract(dot(vec2(pixel), vec2(0.06711056, 0.00583715))));
    return fract(noise + 0.61803399 * float(sample_number));
}

// True where the second of two choices is taken, which has weight `share`; the rest of `threshold` serves the next choice.
bool second_taken(inout float threshold, float share) {
    bool second = threshold < share;
    threshold = second ? threshold / share : (threshold - share) / (1.0 - share);
    return second;
}

Lookup lookup_of(TextureRecord record, vec2 uv, float lod, ivec2 wrap, ivec2 pixel) {
    float threshold = filter_threshold(pixel);
    lod = present_lod(record, lod);
    int number = int(floor(lod));
    if (second_taken(threshold, lod - float(number))) ++number;
    LevelRecord level = levels[record.first_level + number];
    Footprint footprint = footprint_at(level, fixed_coordinates(uv, wrap), wrap);
    int x = second_taken(threshold, footprint.share.x) ? footprint.second.x : footprint.first.x;
    int y = second_taken(threshold, footprint.share.y) ? footprint.second.y : footprint.first.y;
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

// As `decoded_plane`, for all invocations of a work group; `inside`: whether this one has a pixel.
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
