// Decoding several pixels of one decoder in one invocation.
#include "common/visibility.glsl"
#include "ntc/decode_plane.glsl"
#include "generated/shared_decoder.glsl"

layout(rgba32f, binding = IMAGE_TARGET) uniform writeonly image2D target;

// Pixel number `p` of this invocation; `inside` says whether there is one. Defined by the shader that includes this.
ivec2 own_pixel(int p, out bool inside);

#if SHARES_DECODERS
// Decodes pixels 0 to PIXELS - 1. Pixels without a decoder get what their material's factor says.
void decode_pixels() {
    int adapters[PIXELS];
    float x[PIXELS][DECODER_INPUTS];
    vec4 decoded[PIXELS];
    bool any_wanted = false;
    // Compilers unroll loops of constant length, which takes long to compile: the length depends on a uniform.
    // Results are stored by conditional assignments: a CPU stores to arrays with a varying index lane by lane.
    int count = min(network_blocks * PIXELS, PIXELS);
    for (int p = 0; p < count; ++p) {
        bool inside;
        ivec2 pixel = own_pixel(p, inside);
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
        ivec2 pixel = own_pixel(p, inside);
        if (!inside) continue;
        vec4 own = decoded[0];
        for (int q = 1; q < PIXELS; ++q) own = q == p ? decoded[q] : own;
        Surface surface = read_surface(pixel);
        WantedTexel wanted = wanted_texel(surface);
        imageStore(target, pixel, shown_plane(surface, wanted.texture_id, wanted.components, limit_output(own)));
    }
}
#else
// Pixels share nothing but what decoders hold: one after the other.
void decode_pixels() {
    int count = min(network_blocks * PIXELS, PIXELS);
    for (int p = 0; p < count; ++p) {
        bool inside;
        ivec2 pixel = own_pixel(p, inside);
        if (!inside) continue;
        Surface surface = read_surface(pixel);
        imageStore(target, pixel, decoded_plane(surface, pixel));
    }
}
#endif
