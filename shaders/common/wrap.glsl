// Wrapping of texture coordinates (docs/reference/codecs.md#from-u-v-lod-to-levels, steps 1 and 3).
#include "generated/decoding.glsl"
#include "common/numbers.glsl"

// Wraps a coordinate into [0, 1]; NaN and infinity count as 0.
float wrap_coordinate(float coordinate, int mode) {
    if (!is_finite(coordinate)) coordinate = 0.0;
    float repeated = coordinate - floor(coordinate);
    // Distance to the nearest even number. In fp32 it is exact; folding [0, 2) is not, for small negative coordinates.
    float mirrored = abs(coordinate - 2.0 * roundEven(coordinate * 0.5));
    return mode == WRAP_REPEAT ? repeated : (mode == WRAP_MIRROR ? mirrored : clamp(coordinate, 0.0, 1.0));
}
