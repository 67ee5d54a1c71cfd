// Arithmetic of the network (docs/reference/codec-grid.md#precision). HALF_ARITHMETIC 0: single precision. 1: products are halves, sums are
// single precision. 2: sums of hidden layers are halves too. HALF_EMULATED 1: single precision, rounded to halves after each step.
// The output layer is always computed in single precision: it has few products, and their rounding would be the most visible.
// MUL_T and ACC_T are the vector types of factors and of sums, MUL_SCALAR and ACC_SCALAR those of their components.
#ifndef HALF_ARITHMETIC
#define HALF_ARITHMETIC 0
#endif
#ifndef HALF_EMULATED
#define HALF_EMULATED 0
#endif

#if HALF_ARITHMETIC && HALF_EMULATED
// Rounds to the nearest half, ties to even. packHalf2x16 may round differently.
float to_half(float value) {
    uint bits = floatBitsToUint(abs(value));
    uint half_bits = (bits + 0xFFFu + ((bits >> 13) & 1u)) & ~0x1FFFu;
    // Halves below 2^-14 are 2^-24 apart.
    float rounded = bits < 0x38800000u ? roundEven(abs(value) * 16777216.0) / 16777216.0 : uintBitsToFloat(half_bits);
    rounded = half_bits > 0x477FE000u ? uintBitsToFloat(0x7F800000u) : rounded;
    if (bits > 0x7F800000u) return value;
    return value < 0.0 ? -rounded : rounded;
}
vec4 to_half(vec4 value) {
    return vec4(to_half(value.x), to_half(value.y), to_half(value.z), to_half(value.w));
}
#elif HALF_ARITHMETIC
float to_half(float value) {
    return float(float16_t(value));
}
#else
float to_half(float value) {
    return value;
}
#endif

#if HALF_ARITHMETIC && !HALF_EMULATED
#define MUL_SCALAR float16_t
#define MUL_T f16vec4
#else
#define MUL_SCALAR float
#define MUL_T vec4
#endif
// Four weights in the type of factors. Stored halves are not converted to single precision and back, which would cost more than the
// products.
#define WEIGHT_T MUL_T
WEIGHT_T unpacked(uvec2 halves) {
#if HALF_ARITHMETIC && !HALF_EMULATED
    return f16vec4(unpackFloat2x16(halves.x), unpackFloat2x16(halves.y));
#else
    return vec4(unpackHalf2x16(halves.x), unpackHalf2x16(halves.y));
#endif
}
#if HALF_ARITHMETIC == 2 && !HALF_EMULATED
#define ACC_T f16vec4
#define ACC_SCALAR float16_t
#else
#define ACC_T vec4
#define ACC_SCALAR float
#endif

#if HALF_ARITHMETIC == 0
#define ADD_PRODUCT(sum, w, value) sum += w * value
#define ADAPTED(sum, scale, bias) (scale * sum + bias)
#define LEAKY(sum, slope) max(sum, slope * sum)
#define AS_MUL_T(sum) (sum)
#elif !HALF_EMULATED
#define ADD_PRODUCT(sum, w, value) sum += ACC_T(w * value)
#define ADAPTED(sum, scale, bias) (ACC_T(scale) * sum + ACC_T(bias))
#define LEAKY(sum, slope) ACC_T(max(sum, ACC_SCALAR(slope) * sum))
#define AS_MUL_T(sum) MUL_T(sum)
#elif HALF_ARITHMETIC == 1
#define ADD_PRODUCT(sum, w, value) sum += to_half(w * value)
#define ADAPTED(sum, scale, bias) (scale * sum + bias)
#define LEAKY(sum, slope) max(sum, slope * sum)
#define AS_MUL_T(sum) to_half(sum)
#else
#define ADD_PRODUCT(sum, w, value) sum = to_half(sum + to_half(w * value))
#define ADAPTED(sum, scale, bias) to_half(to_half(scale * sum) + bias)
#define LEAKY(sum, slope) max(sum, to_half(to_half(slope) * sum))
#define AS_MUL_T(sum) (sum)
#endif

#define PRODUCT_SUM(values, w) dot(vec4(values), vec4(w))

// In half precision, inputs with even and with odd numbers have separate sums: each accumulates half as many roundings.
#if HALF_ARITHMETIC == 2
#define ODD_ACCUMULATOR(odd) ACC_T odd = ACC_T(0.0);
#define ADD_ODD_PRODUCT(sum, odd, w, value) ADD_PRODUCT(odd, w, value)
#if HALF_EMULATED
#define JOIN_ACCUMULATORS(sum, odd) sum = to_half(sum + odd);
#else
#define JOIN_ACCUMULATORS(sum, odd) sum += odd;
#endif
#else
#define ODD_ACCUMULATOR(odd)
#define ADD_ODD_PRODUCT(sum, odd, w, value) ADD_PRODUCT(sum, w, value)
#define JOIN_ACCUMULATORS(sum, odd)
#endif
