// Decoding a plane of a surface's maps.
#include "ntc/plane.glsl"
#include "ntc/lookup.glsl"

vec4 decoded_plane(Surface surface, ivec2 pixel) {
    WantedTexel wanted = wanted_texel(surface);
    vec4 decoded = vec4(0.0);
    if (wanted.texture_id >= 0) {
        TextureRecord record = textures[wanted.texture_id];
        Lookup lookup = lookup_of(record, wanted.uv, wanted.lod, wanted.wrap, pixel);
        decoded = decode_at(record, lookup.at, lookup.lod, wanted.wrap, true);
    }
    return shown_plane(surface, wanted, decoded);
}
