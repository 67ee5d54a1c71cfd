// Reading a prefiltered environment (viewer/lighting/prefilter.py).
#include "generated/layout.glsl"
#include "lighting/sphere.glsl"

layout(binding = UNIT_ENVIRONMENT) uniform sampler2D environment_maps;
layout(binding = UNIT_BRDF_TABLE) uniform sampler2D brdf_table;
// Of the octahedral map of each roughness: left, top and side in shares of the texture.
uniform vec4 environment_tiles[ENVIRONMENT_LEVELS];
uniform vec3 harmonics[9];
// Cosine and sine of the environment's turn about the vertical axis.
uniform vec2 environment_turn;

vec3 to_environment(vec3 direction) {
    vec2 turn = environment_turn;
    return vec3(turn.x * direction.x + turn.y * direction.z, direction.y, turn.x * direction.z - turn.y * direction.x);
}

vec3 specular_radiance(vec3 direction, float roughness) {
    vec2 place = map_place(to_environment(direction));
    float level = clamp(roughness, 0.0, 1.0) * float(ENVIRONMENT_LEVELS - 1);
    int lower = min(int(level), ENVIRONMENT_LEVELS - 2);
    vec4 near = environment_tiles[lower];
    vec4 far = environment_tiles[lower + 1];
    vec3 sharp = textureLod(environment_maps, near.xy + place * near.zw, 0.0).rgb;
    vec3 blurred = textureLod(environment_maps, far.xy + place * far.zw, 0.0).rgb;
    return mix(sharp, blurred, level - float(lower));
}

// Over pi.
vec3 irradiance_around(vec3 normal) {
    vec3 n = to_environment(normal);
    vec3 sum = harmonics[0] + harmonics[1] * n.y + harmonics[2] * n.z + harmonics[3] * n.x
        + harmonics[4] * (n.x * n.y) + harmonics[5] * (n.y * n.z) + harmonics[6] * (3.0 * n.z * n.z - 1.0)
        + harmonics[7] * (n.x * n.z) + harmonics[8] * (n.x * n.x - n.y * n.y);
    return max(sum, 0.0);
}

vec2 lobe_albedo(float cosine, float roughness) {
    return textureLod(brdf_table, vec2(cosine, roughness), 0.0).xy;
}
