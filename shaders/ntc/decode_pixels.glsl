// Decoding of several pixels of one decoder in one invocation, which fetches each weight once for all of them.
#include "common/visibility.glsl"
#include "ntc/decode_plane.glsl"
#include "generated/shared_decoder.glsl"

layout(rgba32f, binding = IMAGE_TARGET) uniform writeonly image2D target;

// Pixel number `p` of this invocation; `inside` is false if there is none. The including shader defines it.
ivec2 pixel_of(int p, out bool inside);

#if SHARES_DECODERS
// Decodes pixels 0 to PIXELS - 1. Pixels without a decoder show their material's factor.
void decode_pixels() {
    int adapters[PIXELS];
    float x[PIXELS][DECODER_INPUTS];
    vec4 decoded[PIXELS];
    bool any_wanted = false;
    // The loop's length depends on a uniform: compilers would unroll a constant one, and take long.
    // Results are stored by conditional assignments: with a varying index, a CPU stores to an array lane by lane.
    int count = min(network_blocks * PIXELS, PIXELS);
    for (int p = 0; p < count; ++p) {
        bool inside;
        ivec2 pixel = pixel_of(p, inside);
        WantedTexel wanted = wanted_texel(read_surface(pixel));
        int id = max(wanted.texture_id, 0);
        float inputs[DECODER_INPUTS];
        for (int i = 0; i < DECODER_INPUTS; ++i) inputs[i] = 0.0;
        if (wanted.texture_id >= 0 && inside) {
            any_wanted = true;
            Lookup lookup = lookup_of(textures[id], wanted.uv, wanted.lod, wanted.wrap, pixel);
            decoder_input(textures[id], lookup.at, lookup.lod, wanted.wrap, inputs);
        }
        int adapter = textures[id].adapter;
        for (int q = 0; q < PIXELS; ++q) {
            adapters[q] = q == p ? adapter : adapters[q];
            for (int i = 0; i < DECODER_INPUTS; ++i) x[q][i] = q == p ? inputs[i] : x[q][i];
        }
    }
    run_decoders(adapters, x, any_wanted ? network_blocks : 0, decoded);
    for (int p = 0; p < count; ++p) {
        bool inside;
        ivec2 pixel = pixel_of(p, inside);
        if (!inside) continue;
        vec4 value = decoded[0];
        for (int q = 1; q < PIXELS; ++q) value = q == p ? decoded[q] : value;
        Surface surface = read_surface(pixel);
        WantedTexel wanted = wanted_texel(surface);
        imageStore(target, pixel, shown_plane(surface, wanted.texture_id, wanted.components, limit_output(value)));
    }
}
#else
// The codec shares no fetched weights between pixels, so they are decoded one by one.
void decode_pixels() {
    int count = min(network_blocks * PIXELS, PIXELS);
    for (int p = 0; p < count; ++p) {
        bool inside;
        ivec2 pixel = pixel_of(p, inside);
        if (!inside) continue;
        Surface surface = read_surface(pixel);
        imageStore(target, pixel, decoded_plane(surface, pixel));
    }
}
#endif
