// Tests for NaN and infinity by bits: compilers that assume finite numbers remove isnan and isinf.

const uint INFINITE_BITS = 0x7F800000u;

bool is_finite(float value) {
    return (floatBitsToUint(value) & INFINITE_BITS) != INFINITE_BITS;
}

bvec4 are_nan(vec4 values) {
    return greaterThan(floatBitsToUint(values) & 0x7FFFFFFFu, uvec4(INFINITE_BITS));
}
