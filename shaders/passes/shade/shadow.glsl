// How much of the sun a place sees: the shadow map, compared at its four nearest texels and blended.
#include "generated/layout.glsl"

#if SHADOWS
layout(binding = UNIT_SHADOW) uniform sampler2D shadow_map;
// From a place relative to the eye to the shadow map: x, y and depth in [0, 1].
uniform mat4 to_shadow;
// Width of a texel in the world: places are moved that far off their surface, so that it does not shade itself.
uniform float shadow_texel;

float sun_seen(vec3 place, vec3 normal) {
    float cosine = dot(normal, sun_direction);
    // Half a texel's diagonal and half a filter's width, more the more the surface leans away.
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
