// The list of pixels, sorted by decoder: a counting sort whose bins are the decoders.
//
// A wave whose pixels use several decoders runs them one after the other. In the sorted list, each work group has pixels of one decoder.
// Steps: count.comp counts the pixels of each decoder. scan.comp computes by a prefix sum where each decoder's pixels begin. scatter.comp writes
// each pixel into its part of the list. decode.comp runs once for each decoder, by an indirect dispatch, so the CPU reads nothing back.
// docs/explanation/decode-paths.md#binned.
#include "generated/layout.glsl"

layout(std430, binding = BINDING_BINS) buffer Bins {
    BinRecord bins[];
};
layout(std430, binding = BINDING_BIN_PIXELS) buffer BinPixels {
    uint bin_pixels[];    // x | y << 16
};
