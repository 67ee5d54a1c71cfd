// Noise for stochastic choices: the stochastic filter and alpha hashing (docs/explanation/filtering.md#stochastic-filter).
//
// A pixel has one threshold in [0, 1). A choice takes its second option if the threshold is below that option's weight, so each option is
// taken as often as its weight says. Thresholds of neighbouring pixels differ most, which makes the error fine-grained. From sample to sample
// the threshold moves by the golden ratio modulo 1, a low-discrepancy sequence: 16 samples average to nearly the exact filter.
// Thresholds are whole numbers in units of 2^-32. So all drivers get the same bits, whereas they round and contract floats differently.
// Twin in numpy: tests/support/noise.py.

// Interleaved gradient noise: neighbouring pixels differ most (Jimenez 2014, Next generation post processing in Call of Duty). The formula
// is fract(52.9829189 * fract(0.06711056 * x + 0.00583715 * y)). Overflow of 32-bit words takes the place of fract.
uint pixel_noise(uvec2 pixel) {
    uint gradient = pixel.x * 288237660u + pixel.y * 25070368u;
    uint high, low;
    umulExtended(gradient, 3555623499u, high, low);   // the factor is in units of 2^-26
    return (high << 6) | (low >> 26);
}

// Threshold of sample `number` of the stochastic filter. 2654435769 is the golden ratio's fraction in units of 2^-32.
uint filter_threshold(uvec2 pixel, uint number) {
    return pixel_noise(pixel) + number * 2654435769u;
}

// Chooses the second of two options, whose weight is `share`. `threshold` must be below `range`; a range of 0 means 2^32.
// Both become those of the chosen option, so the next choice uses the rest of the threshold. Products are used, because drivers
// approximate quotients.
bool second_taken(inout uint threshold, inout uint range, uint share) {
    uint second, rest;
    umulExtended(range, share, second, rest);
    // The first range is 0, not 2^32 - 1: LLVM 15, in llvmpipe of Mesa 22, crashes at a product with that constant.
    if (range == 0u) second = share;
    bool taken = threshold < second;
    threshold -= taken ? 0u : second;
    range = taken ? second : range - second;
    return taken;
}

uint hash(uint value) {   // PCG RXS-M-XS, O'Neill 2014
    uint state = value * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// A permutation of 0 to 15 for each seed (Kensler 2013, Correlated multi-jittered sampling).
uint permuted(uint number, uint seed) {
    number ^= seed;
    number *= 0xe170893du;
    number ^= seed >> 16u;
    number ^= seed >> 8u;
    number *= 0x0929eb3fu;
    number ^= seed >> 23u;
    number ^= (number & 15u) >> 1u;
    number *= 1u | seed >> 27u;
    number *= 0x6935fa69u;
    number *= 0x74dcb303u;
    number ^= (number & 15u) >> 2u;
    number *= 0x9e501cc3u;
    number ^= (number & 15u) >> 2u;
    number *= 0xc860a3dfu;
    return (number + seed) & 15u;
}

// Threshold of sample `number` (0 to 15) of BLEND surfaces. Samples 1 to 15 move the first threshold by all other sixteenths. Their order
// differs by `layer`, so the coverage of surfaces behind each other is independent.
uint blend_threshold(uvec2 pixel, uint layer, uint number) {
    uint noise = pixel_noise(pixel);
    if (number == 0u) return noise;
    uint seed = hash(layer + hash(pixel.x + hash(pixel.y)));
    uint moved = permuted(number, seed);
    // Offset 0 is used by sample 0 in all layers; the sample that drew it takes the offset that sample 0 would have had.
    if (moved == 0u) moved = permuted(0u, seed);
    return noise + (moved << 28u);
}

// Whether `alpha` covers a pixel: 0 covers none, 1 covers all. The centres of 2^23 steps need 24 bits, which a float has.
bool is_covered(float alpha, uint threshold) {
    return alpha >= float((threshold >> 9u) * 2u + 1u) * (1.0 / 16777216.0);
}
