// Lights of KHR_lights_punctual.
#include "generated/layout.glsl"

struct Light {
    vec4 color;     // linear RGB times intensity; w: 1 / range^2, 0 for an infinite range
    vec4 position;  // relative to the eye; w: 0 for directional lights
    vec4 direction; // in which it shines; w: -cosine of the outer cone times the scale
    vec4 cone;      // x: scale of the cosine between the cones
};

layout(std140, binding = UNIFORM_LIGHTS) uniform Lights {
    Light lights[MOST_LIGHTS];
};

// Direction to the light from a place relative to the eye, and the irradiance there of a surface that faces it.
vec3 light_at(int index, vec3 place, out vec3 towards) {
    Light light = lights[index];
    vec3 offset = light.position.xyz - place * light.position.w;
    float distance2 = max(dot(offset, offset), 1e-6);
    towards = offset * inversesqrt(distance2);
    if (light.position.w == 0.0) return light.color.rgb;
    float end = distance2 * light.color.w;
    float cone = clamp(dot(light.direction.xyz, -towards) * light.cone.x + light.direction.w, 0.0, 1.0);
    return light.color.rgb * (clamp(1.0 - end * end, 0.0, 1.0) / distance2 * cone * cone);
}
