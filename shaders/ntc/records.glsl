// Records of a pack's textures and their mips; latents and decoders are not declared here.
#include "generated/decoding.glsl"
// The plane of maps to decode (ntc/codec/maps.py).
#ifndef PLANE
#define PLANE PLANE_BASE
#endif
// 1: PLANE is a variable.
#ifndef ANY_PLANE
#define ANY_PLANE 0
#endif
#include "generated/codec.glsl"

layout(std430, binding = BINDING_TEXTURES) readonly buffer Textures {
    TextureRecord textures[];
};
layout(std430, binding = BINDING_LEVELS) readonly buffer Levels {
    LevelRecord levels[];
};
