// Reading a prefiltered environment (viewer/lighting/prefilter.py).
#include "generated/layout.glsl"
#include "lighting/sphere.glsl"

layout(binding = UNIT_ENVIRONMENT) uniform sampler2D environment_maps;
layout(binding = UNIT_BRDF_TABLE) uniform sampler2D brdf_table;
// Tiles of the cube maps, one for each roughness and one for irradiance: left, top, width and height of the first face, relative to the
// texture.
uniform vec4 environment_tiles[ENVIRONMENT_LEVELS + 1];
// Distance between faces: two borders.
uniform float face_gap;
// Cosine and sine of the environment's rotation about the vertical axis.
uniform vec2 environment_turn;

vec3 to_environment(vec3 direction) {
    vec2 turn = environment_turn;
    return vec3(turn.x * direction.x + turn.y * direction.z, direction.y, turn.x * direction.z - turn.y * direction.x);
}

vec3 read_map(int level, vec3 place) {
    vec4 tile = environment_tiles[level];
    vec2 at = vec2(tile.x + place.x * (tile.z + face_gap) + place.y * tile.z, tile.y + place.z * tile.w);
    return textureLod(environment_maps, at, 0.0).rgb;
}

vec3 specular_radiance(vec3 direction, float roughness) {
    vec3 place = cube_place(to_environment(direction));
    float level = clamp(roughness, 0.0, 1.0) * float(ENVIRONMENT_LEVELS - 1);
    int lower = min(int(level), ENVIRONMENT_LEVELS - 2);
    return mix(read_map(lower, place), read_map(lower + 1, place), level - float(lower));
}

// Irradiance divided by pi.
vec3 irradiance_around(vec3 normal) {
    return read_map(ENVIRONMENT_LEVELS, cube_place(to_environment(normal)));
}

vec2 lobe_albedo(float cosine, float roughness) {
    return textureLod(brdf_table, vec2(cosine, roughness), 0.0).xy;
}
