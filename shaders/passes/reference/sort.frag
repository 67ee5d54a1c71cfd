#version 430
// Writes each pixel's texture array as depth, so that one pass for each array touches only its own pixels. Pixels
// without a texture get their colour here.
#include "common/materials.glsl"
#include "common/visibility.glsl"

layout(location = 0) out vec4 albedo;

void main() {
    Surface surface = read_surface(ivec2(gl_FragCoord.xy));
    MaterialRecord material = materials[max(surface.material, 0)];
    bool covered = surface.material >= 0;
    albedo = covered ? vec4(material.factor.rgb * surface.color, 1.0) : vec4(0.0);
    bool textured = covered && surface.texture_id >= 0;
    gl_FragDepth = textured ? float(material.image_array + 1) / BUCKET_DEPTHS : 0.0;
}
