#version 430
// Decodes texels of one texture as path `binned` decodes pixels: for timing variants of the decoder (viewer/render/variants.py).
#include "generated/layout.glsl"
layout(local_size_x = BIN_GROUP) in;
#include "ntc/decode.glsl"
#include "generated/shared_decoder.glsl"

layout(std430, binding = BINDING_RESULTS) writeonly buffer Results {
    vec4 results[];
};

void main() {
    fetch_decoder();
    int adapters[PIXELS];
    float x[PIXELS][DECODER_INPUTS];
    vec4 decoded[PIXELS];
    // As in decode_pixels.glsl: no loops of constant length over pixels, no array with a varying index.
    int count = min(network_blocks * PIXELS, PIXELS);
    uint first = gl_WorkGroupID.x * uint(BIN_GROUP * PIXELS) + gl_LocalInvocationID.x;
    for (int p = 0; p < count; ++p) {
        uint number = first + uint(p * BIN_GROUP);
        float inputs[DECODER_INPUTS];
        // 1024 texels a row.
        decoder_input(textures[0], uvec2(number << 22, (number >> 10) << 22), 0.0, ivec2(WRAP_REPEAT), inputs);
        for (int q = 0; q < PIXELS; ++q) {
            adapters[q] = textures[0].adapter;
            for (int i = 0; i < DECODER_INPUTS; ++i) x[q][i] = q == p ? inputs[i] : x[q][i];
        }
    }
    run_decoders(adapters, x, network_blocks, decoded);
    for (int p = 0; p < count; ++p) {
        vec4 value = decoded[0];
        for (int q = 1; q < PIXELS; ++q) value = q == p ? decoded[q] : value;
        results[first + uint(p * BIN_GROUP)] = limit_output(value);
    }
}
