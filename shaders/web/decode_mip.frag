#version 430
// Decodes a plane of one mip of a texture into a target of its size: what an exported page does once it has seen the texture.
#include "ntc/decode.glsl"
#include "common/color.glsl"

uniform int mip;      // of the texture at hand, the only one in `textures`
uniform ivec2 wrap;   // WRAP_ codes

layout(location = 0) out vec4 target;

void main() {
    TextureRecord record = textures[0];
    LevelRecord level = levels[record.first_level + mip];
    ivec2 texel = ivec2(gl_FragCoord.xy);
    uvec2 at = uvec2(texel_centre(texel.x, level.texel_width), texel_centre(texel.y, level.texel_height));
    vec4 decoded = decode_at(record, at, float(mip), wrap, true);
    // Components that the texture does not tell are neutral, as in common/planes.glsl.
    vec4 neutral = PLANE == PLANE_SURFACE ? vec4(0.5, 0.5, 1.0, 1.0) : vec4(1.0);
    vec4 told = mix(neutral, decoded, notEqual(ivec4(record.components >> (4 * PLANE)) & ivec4(1, 2, 4, 8), ivec4(0)));
#if PLANE == PLANE_BASE
    if (record.channels < 3) told.rgb = told.rrr;
    if (record.srgb == 0) told.rgb = linear_to_srgb(told.rgb);
    told.a = 1.0;
#endif
#if PLANE != PLANE_SURFACE
    // The target encodes what it is given.
    told.rgb = srgb_to_linear(told.rgb);
#endif
    target = told;
}
