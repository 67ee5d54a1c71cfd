// The list of pixels, sorted by decoder.
#include "generated/layout.glsl"

layout(std430, binding = BINDING_BINS) buffer Bins {
    BinRecord bins[];
};
layout(std430, binding = BINDING_BIN_PIXELS) buffer BinPixels {
    uint bin_pixels[];    // x, and y shifted by 16
};
