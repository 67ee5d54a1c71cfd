// The weights of one decoder, bound as a range of a uniform buffer.
// DECODER_PLACE 0: the range holds the weights. 1: it holds the decoder's place among all weights, which are read there.
#ifndef DECODER_PLACE
#define DECODER_PLACE 0
#endif

#if DECODER_PLACE == 0
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

WEIGHT_T decoder_weight(int block) {
#if PRECISION_FP16
    uvec4 pair = decoder_elements[block >> 1];
    return unpacked((block & 1) == 0 ? pair.xy : pair.zw);
#else
    return decoder_elements[block];
#endif
}
#else
layout(std140, binding = UNIFORM_DECODER) uniform Decoder {
    ivec4 decoder_place;    // x: the decoder's first block among all weights
};

WEIGHT_T decoder_weight(int block) {
    return weight(decoder_place.x + block);
}
#endif
