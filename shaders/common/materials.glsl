// The scene's materials.
#include "generated/layout.glsl"

layout(std430, binding = BINDING_MATERIALS) readonly buffer Materials {
    MaterialRecord materials[];
};
