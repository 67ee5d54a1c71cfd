#version 430
// Prefiltered environment: the cube map of one roughness, with borders. A texel is the mean radiance around its direction, weighted by the
// GGX lobe of a mirror direction along the normal (split-sum approximation, Karis 2013, "Real Shading in Unreal Engine 4").
// Filtered importance sampling (Krivanek and Colbert 2008, "Real-time Shading with Filtered Importance Sampling"): directions are drawn by the
// lobe, and each reads the mip of the source whose texels are as large as the solid angle of a sample. So few samples give no noise.
// viewer/lighting/prefilter.py makes the samples. docs/explanation/lighting.md#light.
#include "generated/layout.glsl"
#include "lighting/sphere.glsl"

layout(binding = UNIT_ENVIRONMENT) uniform sampler2D source;
// xyz: direction around (0, 0, 1), whose z is also its weight; w: mip of the source.
layout(std140, binding = UNIFORM_SAMPLES) uniform Samples {
    vec4 lobe[MOST_SAMPLES];
};
uniform int top;        // first row of the cube map's border
uniform int side;       // side of a face, without border
uniform int samples;
layout(location = 0) out vec4 mean;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy) - ivec2(0, top);
    int face = texel.x / (side + 2);
    vec3 axis = cube_direction(face, (vec2(texel.x - face * (side + 2), texel.y) - 0.5) / float(side));
    // Basis around `axis`: Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    float turn = axis.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (turn + axis.z);
    float b = axis.x * axis.y * a;
    vec3 first = vec3(1.0 + turn * axis.x * axis.x * a, turn * b, -turn * axis.x);
    vec3 second = vec3(b, turn + axis.y * axis.y * a, -axis.y);
    vec3 sum = vec3(0.0);
    float weights = 0.0;
    for (int i = 0; i < samples; ++i) {
        vec3 direction = lobe[i].x * first + lobe[i].y * second + lobe[i].z * axis;
        sum += lobe[i].z * textureLod(source, map_place(direction), lobe[i].w).rgb;
        weights += lobe[i].z;
    }
    mean = vec4(sum / weights, 1.0);
}
