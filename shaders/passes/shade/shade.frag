#version 430
// Shades and tone-maps the lit picture (docs/explanation/lighting.md). Twin in float64: viewer/lighting/shading.py.
// SUN, SHADOWS, LIGHTS 1: the view has them. CLEARCOAT, SPECULAR, EMISSIVE, UNLIT 1: any material has such factors.
// Pixels without a surface are drawn too; background.frag replaces them.
#include "common/frame.glsl"
#include "common/materials.glsl"
#include "common/surface.glsl"
#include "lighting/environment.glsl"
#include "lighting/brdf.glsl"
#include "lighting/tone_map.glsl"
#if LIGHTS
#include "lighting/lights.glsl"
#endif
#include "passes/shade/maps.glsl"
#include "passes/shade/view.glsl"

layout(binding = UNIT_SURFACE) uniform usampler2D surface_words;
layout(binding = UNIT_SURFACE_FRAME) uniform usampler2D surface_frames;
layout(binding = UNIT_SURFACE_DEPTH) uniform sampler2D surface_depth;
// Matrix from normalized device coordinates and depth to a place relative to the eye.
uniform mat4 from_clip;
uniform vec3 sun_irradiance;
uniform int light_count;

layout(location = 0) out vec4 picture;

#if SHADOWS
layout(binding = UNIT_SHADOW) uniform sampler2D shadow_map;
// Matrix from a place relative to the eye to the shadow map: x, y and depth in [0, 1].
uniform mat4 to_shadow;
// Width of a texel in the world. Places are moved off their surface by about this, or the surface would shade itself.
uniform float shadow_texel;

// Share of the sun that is visible from a place: the depth test at the four nearest texels of the shadow map, blended.
float sun_seen(vec3 place, vec3 normal) {
    float cosine = dot(normal, sun_direction);
    // Offset of half a texel's diagonal and half a filter's width; more if the surface is tilted away from the sun.
    float leaning = sqrt(clamp(1.0 - cosine * cosine, 0.0, 1.0));
    vec3 at = (to_shadow * vec4(place + normal * (shadow_texel * (0.5 + 1.5 * leaning)), 1.0)).xyz;
    if (any(lessThan(at, vec3(0.0))) || any(greaterThan(at, vec3(1.0)))) return 1.0;
    vec2 texel = at.xy * vec2(textureSize(shadow_map, 0)) - 0.5;
    vec2 share = fract(texel);
    // Counter-clockwise from the upper left.
    vec4 nearest = textureGather(shadow_map, (floor(texel) + 1.0) / vec2(textureSize(shadow_map, 0)));
    vec4 lit = vec4(greaterThanEqual(nearest, vec4(at.z)));
    return mix(mix(lit.w, lit.z, share.x), mix(lit.x, lit.y, share.x), share.y);
}
#endif

// Reflected light of all sources, without emission.
vec3 reflected(Reflection surface, Seen seen, float occlusion, vec3 place, float sun_share) {
    vec3 mirrored = 2.0 * dot(seen.normal, seen.view) * seen.normal - seen.view;
    vec3 light = environment_response(
        surface, seen, specular_radiance(mirrored, surface.roughness), irradiance_around(seen.normal)
    ) * occlusion;
#if SUN
    light += light_response(surface, seen, sun_direction) * (sun_irradiance * sun_share);
#endif
#if LIGHTS
    for (int i = 0; i < light_count; ++i) {
        vec3 towards;
        vec3 received = light_at(i, place, towards);
        light += light_response(surface, seen, towards) * received;
    }
#endif
    return light;
}

Seen seen_along(vec3 normal, vec3 view, float roughness) {
    float cosine = clamp(dot(normal, view), SMALLEST_COSINE, 1.0);
    return Seen(normal, view, cosine, lobe_albedo(cosine, roughness));
}

vec3 mapped_normal(Frame frame, vec2 stored, float scale) {
    vec2 xy = stored * 2.0 - 1.0;
    float z = sqrt(max(1.0 - dot(xy, xy), 0.0));
    xy *= scale;
    vec3 bitangent = cross(frame.normal, frame.tangent) * frame.handedness;
    vec3 mapped = frame.tangent * xy.x + bitangent * xy.y + frame.normal * z;
    float length_squared = dot(mapped, mapped);
    // If the mapped normal has no length, the surface's normal is used.
    return length_squared > 1e-8 ? mapped * inversesqrt(length_squared) : frame.normal;
}

vec3 surface_radiance(ivec2 pixel, int number, vec3 view, vec2 ndc) {
    Maps maps = read_maps(pixel);
#if SPECULAR
    vec4 factors = materials[number].surface;
    vec4 specular = materials[number].specular;
#else
    vec4 factors = vec4(materials[number].surface.xyz, 0.0);
    const vec4 specular = vec4(vec3(0.04), 1.0);
#endif
    Frame frame = unpack_frame(texelFetch(surface_frames, pixel, 0).xy);
    vec3 normal = mapped_normal(frame, maps.surface.NORMAL_COMPONENTS, factors.z);
    Reflection surface = Reflection(
        maps.base * (1.0 - factors.w),
        maps.base,
        specular.rgb,
        specular.a,
        clamp(maps.surface.METALNESS_COMPONENTS * factors.y, 0.0, 1.0),
        clamp(maps.surface.ROUGHNESS_COMPONENTS * factors.x, 0.0, 1.0)
    );
    float occlusion = 1.0 + materials[number].emissive.a * (maps.emission.OCCLUSION_COMPONENTS - 1.0);
    vec3 place = vec3(0.0);
#if LIGHTS || SHADOWS
    vec4 homogeneous = from_clip * vec4(ndc, texelFetch(surface_depth, pixel, 0).x * 2.0 - 1.0, 1.0);
    place = homogeneous.xyz / homogeneous.w;
#endif
    float sun_share = 1.0;
#if SHADOWS
    sun_share = sun_seen(place, frame.normal);
#endif
    vec3 radiance = reflected(surface, seen_along(normal, view, surface.roughness), occlusion, place, sun_share);
#if EMISSIVE
    radiance += maps.emission.EMISSIVE_COMPONENTS * materials[number].emissive.rgb;
#endif
#if CLEARCOAT
    float coat = materials[number].clearcoat;
    if (coat > 0.0) {
        // The coat's normal map is not read; the coat has the surface's normal.
        Reflection clear = Reflection(vec3(0.0), vec3(0.0), vec3(0.04), 1.0, 0.0, materials[number].clearcoat_roughness);
        Seen seen = seen_along(frame.normal, view, clear.roughness);
        float transmitted = 1.0 - coat * (0.04 + 0.96 * power5(1.0 - seen.cosine));
        radiance = radiance * transmitted + coat * reflected(clear, seen, occlusion, place, sun_share);
    }
#endif
    return radiance;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int number = max(surface_material(texelFetch(surface_words, pixel, 0).x), 0);
    vec2 ndc = gl_FragCoord.xy / picture_size * 2.0 - 1.0;
    vec3 view = -normalize(ray_middle + ndc.x * ray_right + ndc.y * ray_up);
    picture = vec4(tone_mapped(surface_radiance(pixel, number, view, ndc), exposure_factor), 1.0);
#if UNLIT
    if (materials[number].unlit != 0) picture.rgb = clamp(read_maps(pixel).base, 0.0, 1.0);
#endif
}
