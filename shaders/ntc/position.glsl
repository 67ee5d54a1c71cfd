// Texture coordinates in fixed point, in units of 2^-32 of the texture's side (docs/reference/codecs.md#from-u-v-lod-to-levels). On a side of
// 16384 texels, fp32 would leave 10 bits within a texel, which are too few for the waves of the positional encoding.
#include "common/wrap.glsl"

// `coordinate` wrapped into [0, 1), in units of 2^-32; NaN and infinity count as 0.
uint fixed_coordinate(float coordinate, int mode) {
    // With `repeat`, a negative coordinate -x becomes 1 - x as an integer: fp32 would drop the low bits of a small x.
    bool from_end = mode == WRAP_REPEAT && coordinate < 0.0;
    float wrapped = wrap_coordinate(from_end ? -coordinate : coordinate, mode);
    uint steps = wrapped >= 1.0 ? 0xFFFFFFFFu : uint(wrapped * 4294967296.0);
    return from_end && wrapped > 0.0 ? ~steps : steps;
}

uvec2 fixed_coordinates(vec2 uv, ivec2 wrap) {
    return uvec2(fixed_coordinate(uv.x, wrap.x), fixed_coordinate(uv.y, wrap.y));
}

// A position along a side that is divided into equal parts: texels or cells.
struct Place {
    uint part;
    uint within;   // position in the part, in units of 2^-32
};

Place place_along(uint coordinate, int parts) {
    Place place;
    umulExtended(coordinate, uint(parts), place.part, place.within);
    return place;
}

// Converts steps of 2^-32 to a fraction in [0, 1].
float as_fraction(uint steps) {
    return float(steps) * (1.0 / 4294967296.0);
}

// The centre of texel `texel` of a side of `texels`, in units of 2^-32 of the side.
uint texel_centre(int texel, int texels) {
    uint near = uint((0.5 + float(texel)) / float(texels) * 4294967296.0);
    // The quotient in fp32 may be off by thousandths of a texel. Integers correct it.
    int missing = int(0x80000000u - place_along(near, texels).within);
    return near + uint(int(roundEven(float(missing) / float(texels))));
}
