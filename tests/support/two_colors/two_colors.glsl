// Codec `two_colors`: two colours and an index a texel. Included by ntc/decode.glsl. Always in single precision.

vec4 unpacked_color(uint bytes) {
    return vec4(bytes & 255u, (bytes >> 8) & 255u, (bytes >> 16) & 255u, bytes >> 24) / 255.0;
}

vec4 texel_value(LevelRecord level, ivec2 texel) {
    ivec2 block = texel / BLOCK_SIDE;
    ivec2 within = texel - block * BLOCK_SIDE;
    int word = (level.first_cell + block.y * level.width + block.x) * CELL_WORDS + PLANE_WORDS * PLANE_PLACE;
    uint index = (stored_word(word + 2) >> uint(2 * (within.y * BLOCK_SIDE + within.x))) & 3u;
    return mix(unpacked_color(stored_word(word)), unpacked_color(stored_word(word + 1)), float(index) / 3.0);
}

#if FILTER_STOCHASTIC
// At the centre of a texel of a mip that is there, as `lookup_of` gives it: that texel.
vec4 decode_at(TextureRecord record, uvec2 at, float lod, ivec2 wrap, bool wanted) {
    LevelRecord level = levels[record.first_level + int(lod)];
    ivec2 texel = ivec2(place_along(at.x, level.texel_width).part, place_along(at.y, level.texel_height).part);
    return texel_value(level, texel);
}
#else
vec4 level_value(LevelRecord level, uvec2 at, ivec2 wrap) {
    Footprint footprint = footprint_at(level, at, wrap);
    ivec2 first = footprint.first;
    ivec2 second = footprint.second;
    vec4 upper = mix(texel_value(level, first), texel_value(level, ivec2(second.x, first.y)), footprint.share.x);
    vec4 lower = mix(texel_value(level, ivec2(first.x, second.y)), texel_value(level, second), footprint.share.x);
    return mix(upper, lower, footprint.share.y);
}

// The codec's part of `decode_texture`: `at` is wrapped and in units of 2^-32.
vec4 decode_at(TextureRecord record, uvec2 at, float lod, ivec2 wrap, bool wanted) {
    lod = present_lod(record, lod);
    int lower = int(floor(lod));
    float share = lod - float(lower);
    vec4 value = level_value(levels[record.first_level + lower], at, wrap);
    if (share > 0.0) value = mix(value, level_value(levels[record.first_level + lower + 1], at, wrap), share);
    return value;
}
#endif
