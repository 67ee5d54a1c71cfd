// The weights of one decoder, bound as a range of the buffer of all decoders.
// DECODER_IN_STORAGE 1: decoders are larger than the driver's limit of uniform buffers, and are read from all weights.
#ifndef DECODER_IN_STORAGE
#define DECODER_IN_STORAGE 0
#endif

#if WEIGHTS_IN_IMAGE || DECODER_IN_STORAGE
layout(std140, binding = UNIFORM_DECODER) uniform Decoder {
    ivec4 decoder_place;    // x: the decoder's first block among all weights
};

vec4 decoder_weight(int block) {
    return weight(decoder_place.x + block);
}
#else

#if PRECISION_FP16
// Two blocks of four halves in each element: std140 pads elements of arrays to 16 bytes.
#define DECODER_ELEMENT uvec4
#define DECODER_ELEMENTS ((DECODER_BLOCKS + 1) / 2)
#else
#define DECODER_ELEMENT vec4
#define DECODER_ELEMENTS DECODER_BLOCKS
#endif

layout(std140, binding = UNIFORM_DECODER) uniform Decoder {
    DECODER_ELEMENT decoder_elements[DECODER_ELEMENTS];
};

vec4 decoder_weight(int block) {
#if PRECISION_FP16
    uvec4 pair = decoder_elements[block >> 1];
    uvec2 halves = (block & 1) == 0 ? pair.xy : pair.zw;
    return vec4(unpackHalf2x16(halves.x), unpackHalf2x16(halves.y));
#else
    return decoder_elements[block];
#endif
}
#endif
