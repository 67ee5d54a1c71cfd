// Tone mapping: from radiance to linear light in [0, 1]. Twin in float64: viewer/lighting/tone_maps.py.
// TONE_MAP: 0 only clips, 1 Khronos PBR Neutral, 2 AgX.

// KhronosGroup/ToneMapping, PBR_Neutral.
vec3 neutral_tones(vec3 radiance) {
    const float start = 0.8 - 0.04;
    const float desaturation = 0.15;
    float lowest = min(radiance.r, min(radiance.g, radiance.b));
    vec3 color = radiance - (lowest < 0.08 ? lowest - 6.25 * lowest * lowest : 0.04);
    float peak = max(color.r, max(color.g, color.b));
    if (peak < start) return color;
    const float span = 1.0 - start;
    float compressed = 1.0 - span * span / (peak + span - start);
    float share = 1.0 - 1.0 / (desaturation * (peak - compressed) + 1.0);
    return mix(color * (compressed / peak), vec3(compressed), share);
}

// Wrensch 2023, a fit of Sobotka's AgX; decoded with a gamma of 2.2.
vec3 agx_tones(vec3 radiance) {
    const mat3 inset = mat3(
        0.842479062253094, 0.0423282422610123, 0.0423756549057051,
        0.0784335999999992, 0.878468636469772, 0.0784336,
        0.0792237451477643, 0.0791661274605434, 0.879142973793104
    );
    const mat3 outset = mat3(
        1.19687900512017, -0.0528968517574562, -0.0529716355144438,
        -0.0980208811401368, 1.15190312990417, -0.0980434501171241,
        -0.0990297440797205, -0.0989611768448433, 1.15107367264116
    );
    const float low = -12.47393;
    const float high = 4.026069;
    vec3 x = (clamp(log2(max(inset * radiance, 1e-10)), low, high) - low) / (high - low);
    vec3 x2 = x * x;
    vec3 x4 = x2 * x2;
    vec3 curve = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    return pow(clamp(outset * curve, 0.0, 1.0), vec3(2.2));
}

vec3 tone_mapped(vec3 radiance, float exposure_factor) {
    vec3 exposed = max(radiance, 0.0) * exposure_factor;
#if TONE_MAP == 1
    exposed = neutral_tones(exposed);
#elif TONE_MAP == 2
    exposed = agx_tones(exposed);
#endif
    return clamp(exposed, 0.0, 1.0);
}
