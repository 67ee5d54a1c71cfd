#version 430
// The octahedral map of one roughness, with its border: means of the source around each direction under GGX
// (Krivanek and Colbert 2008, "Real-time Shading with Filtered Importance Sampling").
#include "generated/layout.glsl"
#include "lighting/sphere.glsl"

layout(local_size_x = GROUP_SIDE, local_size_y = GROUP_SIDE) in;
layout(binding = UNIT_ENVIRONMENT) uniform sampler2D source;
layout(binding = IMAGE_ENVIRONMENT, rgba32f) uniform writeonly image2D environment_maps;
// Direction around (0, 0, 1), whose z is its weight, and the source's level.
layout(std140, binding = UNIFORM_SAMPLES) uniform Samples {
    vec4 lobe[MOST_SAMPLES];
};
uniform ivec3 tile;     // left and top of its border, side without
uniform int samples;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (max(texel.x, texel.y) >= tile.z + 2) return;
    vec3 axis = map_direction((vec2(texel) - 0.5) / float(tile.z));
    // Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    float side = axis.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (side + axis.z);
    float b = axis.x * axis.y * a;
    vec3 first = vec3(1.0 + side * axis.x * axis.x * a, side * b, -side * axis.x);
    vec3 second = vec3(b, side + axis.y * axis.y * a, -axis.y);
    vec3 sum = vec3(0.0);
    float weights = 0.0;
    for (int i = 0; i < samples; ++i) {
        vec3 direction = lobe[i].x * first + lobe[i].y * second + lobe[i].z * axis;
        sum += lobe[i].z * textureLod(source, map_place(direction), lobe[i].w).rgb;
        weights += lobe[i].z;
    }
    imageStore(environment_maps, tile.xy + texel, vec4(sum / weights, 1.0));
}
