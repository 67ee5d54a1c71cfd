#version 430
// Draws the environment, and the sun's disk in front of it, where there is no surface.
#include "generated/layout.glsl"
#include "lighting/environment.glsl"
#include "lighting/tone_map.glsl"
#include "passes/shade/view.glsl"

layout(binding = UNIT_PANORAMA) uniform sampler2D panorama;
uniform float sun_radius;
uniform vec3 sun_radiance;

layout(location = 0) out vec4 picture;

void main() {
    vec2 ndc = gl_FragCoord.xy / picture_size * 2.0 - 1.0;
    vec3 direction = normalize(ray_middle + ndc.x * ray_right + ndc.y * ray_up);
    vec3 radiance = textureLod(panorama, panorama_place(to_environment(direction)), 0.0).rgb;
#if SUN_DISK
    // The chord between unit vectors is exact for small angles, where the cosine loses its digits.
    float away = length(direction - sun_direction);
    radiance += sun_radiance * clamp((sun_radius - away) / (0.1 * sun_radius) + 0.5, 0.0, 1.0);
#endif
    picture = vec4(tone_mapped(radiance, exposure_factor), 0.0);
}
