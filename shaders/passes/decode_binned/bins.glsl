// The list of pixels, sorted by decoder (bin).
#include "generated/layout.glsl"

layout(std430, binding = BINDING_BINS) buffer Bins {
    BinRecord bins[];
};
layout(std430, binding = BINDING_BIN_PIXELS) buffer BinPixels {
    uint bin_pixels[];    // x | y << 16
};
