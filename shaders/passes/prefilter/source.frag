#version 430
// Converts a panorama to an octahedral map. Each texel is the mean of `steps` x `steps` samples.
#include "generated/layout.glsl"
#include "lighting/sphere.glsl"

layout(binding = UNIT_PANORAMA) uniform sampler2D panorama;
uniform int side;        // side of the map
uniform int steps;
layout(location = 0) out vec4 mean;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec3 sum = vec3(0.0);
    for (int y = 0; y < steps; ++y) {
        for (int x = 0; x < steps; ++x) {
            vec2 place = (vec2(texel * steps + ivec2(x, y)) + 0.5) / float(side * steps);
            sum += textureLod(panorama, panorama_place(map_direction(place)), 0.0).rgb;
        }
    }
    mean = vec4(sum / float(steps * steps), 1.0);
}
