#pragma once

#if !defined(__CUDACC_RTC__)
#include <cmath>
#include <cstring>
#endif

#if defined(__CUDACC__)
#define NTC_FUNCTION __host__ __device__ inline
#else
#define NTC_FUNCTION inline
#endif

namespace ntc {

using uint = unsigned int;

// Vectors of two to four components. A constructor with a single number sets all components to it.
template <typename T> struct vector2 {
    T x, y;
    vector2() = default;
    NTC_FUNCTION constexpr vector2(T first, T second) : x(first), y(second) {}
    NTC_FUNCTION explicit constexpr vector2(T all) : x(all), y(all) {}
    template <typename S> NTC_FUNCTION explicit constexpr vector2(vector2<S> other) : x(T(other.x)), y(T(other.y)) {}
    NTC_FUNCTION T operator[](int component) const { return component == 0 ? x : y; }
};
template <typename T> struct vector4;
template <typename T> struct vector3 {
    T x, y, z;
    vector3() = default;
    NTC_FUNCTION constexpr vector3(T first, T second, T third) : x(first), y(second), z(third) {}
    NTC_FUNCTION explicit constexpr vector3(T all) : x(all), y(all), z(all) {}
    NTC_FUNCTION explicit constexpr vector3(vector4<T> other) : x(other.x), y(other.y), z(other.z) {}
};
template <typename T> struct vector4 {
    T x, y, z, w;
    vector4() = default;
    NTC_FUNCTION constexpr vector4(T first, T second, T third, T fourth) : x(first), y(second), z(third), w(fourth) {}
    NTC_FUNCTION explicit constexpr vector4(T all) : x(all), y(all), z(all), w(all) {}
    NTC_FUNCTION constexpr vector4(vector2<T> two, T third, T fourth) : x(two.x), y(two.y), z(third), w(fourth) {}
    NTC_FUNCTION constexpr vector4(vector3<T> three, T fourth) : x(three.x), y(three.y), z(three.z), w(fourth) {}
    template <typename S> NTC_FUNCTION explicit constexpr vector4(vector4<S> other)
        : x(T(other.x)), y(T(other.y)), z(T(other.z)), w(T(other.w)) {}
};
using vec2 = vector2<float>;
using vec3 = vector3<float>;
using vec4 = vector4<float>;
using ivec2 = vector2<int>;
using ivec4 = vector4<int>;
using uvec2 = vector2<uint>;
using uvec4 = vector4<uint>;
using bvec2 = vector2<bool>;
using bvec4 = vector4<bool>;

// Operators between two vectors, or a vector and a number.
#define NTC_OPERATOR(op)                                                                                              \
    template <typename T> NTC_FUNCTION vector2<T> operator op(vector2<T> a, vector2<T> b) {                           \
        return {T(a.x op b.x), T(a.y op b.y)};                                                                        \
    }                                                                                                                 \
    template <typename T> NTC_FUNCTION vector3<T> operator op(vector3<T> a, vector3<T> b) {                           \
        return {T(a.x op b.x), T(a.y op b.y), T(a.z op b.z)};                                                         \
    }                                                                                                                 \
    template <typename T> NTC_FUNCTION vector4<T> operator op(vector4<T> a, vector4<T> b) {                           \
        return {T(a.x op b.x), T(a.y op b.y), T(a.z op b.z), T(a.w op b.w)};                                          \
    }                                                                                                                 \
    template <typename T> NTC_FUNCTION vector2<T> operator op(vector2<T> a, T b) { return a op vector2<T>(b); }       \
    template <typename T> NTC_FUNCTION vector3<T> operator op(vector3<T> a, T b) { return a op vector3<T>(b); }       \
    template <typename T> NTC_FUNCTION vector4<T> operator op(vector4<T> a, T b) { return a op vector4<T>(b); }       \
    template <typename T> NTC_FUNCTION vector2<T> operator op(T a, vector2<T> b) { return vector2<T>(a) op b; }       \
    template <typename T> NTC_FUNCTION vector3<T> operator op(T a, vector3<T> b) { return vector3<T>(a) op b; }       \
    template <typename T> NTC_FUNCTION vector4<T> operator op(T a, vector4<T> b) { return vector4<T>(a) op b; }
NTC_OPERATOR(+)
NTC_OPERATOR(-)
NTC_OPERATOR(*)
NTC_OPERATOR(/)
NTC_OPERATOR(&)
#undef NTC_OPERATOR
NTC_FUNCTION uvec4 operator>>(uvec4 v, int bits) { return {v.x >> bits, v.y >> bits, v.z >> bits, v.w >> bits}; }
template <typename V> NTC_FUNCTION V& operator+=(V& sum, V value) { return sum = sum + value; }
template <typename V> NTC_FUNCTION V& operator-=(V& sum, V value) { return sum = sum - value; }
NTC_FUNCTION vec4& operator*=(vec4& product, float factor) { return product = product * factor; }

// Four columns.
struct mat4 {
    vec4 columns[4];
    mat4() = default;
    NTC_FUNCTION mat4(vec4 a, vec4 b, vec4 c, vec4 d) : columns{a, b, c, d} {}
};
NTC_FUNCTION vec4 operator*(const mat4& m, vec4 v) {
    return m.columns[0] * v.x + m.columns[1] * v.y + m.columns[2] * v.z + m.columns[3] * v.w;
}

// Functions of GLSL.
NTC_FUNCTION uint float_bits_to_uint(float value) {
#if defined(__CUDA_ARCH__)
    return __float_as_uint(value);
#else
    uint bits;
    std::memcpy(&bits, &value, sizeof bits);
    return bits;
#endif
}
NTC_FUNCTION float uint_bits_to_float(uint bits) {
#if defined(__CUDA_ARCH__)
    return __uint_as_float(bits);
#else
    float value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
#endif
}
NTC_FUNCTION vec4 uint_bits_to_float(uvec4 bits) {
    return {uint_bits_to_float(bits.x), uint_bits_to_float(bits.y), uint_bits_to_float(bits.z), uint_bits_to_float(bits.w)};
}
NTC_FUNCTION uvec4 float_bits_to_uint(vec4 v) {
    return {float_bits_to_uint(v.x), float_bits_to_uint(v.y), float_bits_to_uint(v.z), float_bits_to_uint(v.w)};
}
NTC_FUNCTION int bit_count(uint value) {
    int count = 0;
    for (; value != 0u; value &= value - 1u) ++count;
    return count;
}
NTC_FUNCTION uint product_high(uint a, uint b) {
    return uint((static_cast<unsigned long long>(a) * b) >> 32);
}
NTC_FUNCTION float floor(float value) { return ::floorf(value); }
NTC_FUNCTION float abs(float value) { return ::fabsf(value); }
NTC_FUNCTION float exp2(float value) { return ::exp2f(value); }
NTC_FUNCTION float sqrt(float value) { return ::sqrtf(value); }
NTC_FUNCTION vec4 sqrt(vec4 v) { return {sqrt(v.x), sqrt(v.y), sqrt(v.z), sqrt(v.w)}; }
NTC_FUNCTION float round_even(float value) { return ::rintf(value); }
template <typename T> NTC_FUNCTION T larger(T a, T b) { return a < b ? b : a; }
template <typename T> NTC_FUNCTION T smaller(T a, T b) { return b < a ? b : a; }
template <typename T> NTC_FUNCTION vector4<T> larger(vector4<T> a, vector4<T> b) {
    return {larger(a.x, b.x), larger(a.y, b.y), larger(a.z, b.z), larger(a.w, b.w)};
}
template <typename T> NTC_FUNCTION vector4<T> smaller(vector4<T> a, vector4<T> b) {
    return {smaller(a.x, b.x), smaller(a.y, b.y), smaller(a.z, b.z), smaller(a.w, b.w)};
}
template <typename T> NTC_FUNCTION T clamp(T value, T lowest, T highest) { return smaller(larger(value, lowest), highest); }
NTC_FUNCTION vec4 mix(vec4 a, vec4 b, vec4 share) { return a * (vec4(1.0f) - share) + b * share; }
NTC_FUNCTION float dot(vec4 a, vec4 b) { return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w; }
// Components of `second` where `choice` is true, of `first` elsewhere.
NTC_FUNCTION vec2 chosen(vec2 first, vec2 second, bvec2 choice) {
    return {choice.x ? second.x : first.x, choice.y ? second.y : first.y};
}
NTC_FUNCTION vec4 chosen(vec4 a, vec4 b, bvec4 choice) {
    return {choice.x ? b.x : a.x, choice.y ? b.y : a.y, choice.z ? b.z : a.z, choice.w ? b.w : a.w};
}
template <typename T> NTC_FUNCTION bvec2 equal(vector2<T> a, vector2<T> b) { return {a.x == b.x, a.y == b.y}; }
template <typename T> NTC_FUNCTION bvec4 equal(vector4<T> a, vector4<T> b) {
    return {a.x == b.x, a.y == b.y, a.z == b.z, a.w == b.w};
}
template <typename T> NTC_FUNCTION bvec4 greaterThan(vector4<T> a, vector4<T> b) {
    return {a.x > b.x, a.y > b.y, a.z > b.z, a.w > b.w};
}
NTC_FUNCTION bool any(bvec4 v) { return v.x || v.y || v.z || v.w; }

// Decoder of the data in `words`: ntc_pack.bin, in host or device memory.
struct decoder {
    const uint* words;
    uint count;    // number of words

    // Words beyond the end are 0, so that damaged data cannot cause reads outside the array.
    NTC_FUNCTION uint word(int place) const { return uint(place) < count ? words[place] : 0u; }

    // MEMBERS
};

}  // namespace ntc
