// Noise by which shaders choose. Whole numbers have the same bits with every driver; floats would be rounded and contracted differently.
// Thresholds are in units of 2^-32. tests/support/noise.py is the same in numpy.

// Interleaved gradient noise: neighbouring pixels differ most (Jimenez 2014, Next generation post processing in Call of Duty). The formula
// is fract(52.9829189 * fract(0.06711056 * x + 0.00583715 * y)); words that overflow drop what fract drops.
uint pixel_noise(uvec2 pixel) {
    uint gradient = pixel.x * 288237660u + pixel.y * 25070368u;
    uint high, low;
    umulExtended(gradient, 3555623499u, high, low);   // the factor is in units of 2^-26
    return (high << 6) | (low >> 26);
}

// Threshold of a sample of the stochastic filter. From sample to sample it moves by the golden ratio, so that each texel is taken about
// as often as its weight says.
uint filter_threshold(uvec2 pixel, uint number) {
    return pixel_noise(pixel) + number * 2654435769u;
}

// True where the second of two choices is taken, whose weight is `share`. `threshold` is below `range`; a range of 0 counts as 2^32.
// Both are narrowed for the next choice, by products: drivers approximate quotients.
bool second_taken(inout uint threshold, inout uint range, uint share) {
    uint second, rest;
    umulExtended(range, share, second, rest);
    // Not 2^32 - 1 as the first range: LLVM 15, which llvmpipe of Mesa 22 uses, crashes at a product with that constant.
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

// Threshold of a sample of BLEND surfaces, 0 to 15. Further samples move the first one by all other sixteenths, in an order that differs from
// `layer` to layer: of what one surface lets through, one behind it covers its own share.
uint blend_threshold(uvec2 pixel, uint layer, uint number) {
    uint noise = pixel_noise(pixel);
    if (number == 0u) return noise;
    uint seed = hash(layer + hash(pixel.x + hash(pixel.y)));
    uint moved = permuted(number, seed);
    // The first sample is the same everywhere, so that number 0 is taken.
    if (moved == 0u) moved = permuted(0u, seed);
    return noise + (moved << 28u);
}

// `alpha` covers a pixel: 0 covers none, 1 all. The middles of 2^23 steps need 24 bits, which a float has.
bool is_covered(float alpha, uint threshold) {
    return alpha >= float((threshold >> 9u) * 2u + 1u) * (1.0 / 16777216.0);
}
