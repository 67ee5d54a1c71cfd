// Decoding several pixels of one decoder in one invocation.
#include "common/visibility.glsl"
#include "ntc/albedo.glsl"
#include "generated/shared_network.glsl"

layout(rgba32f, binding = IMAGE_ALBEDO) uniform writeonly image2D albedo;

// `inside`: which of the pixels there are. A pixel that decodes nothing shows its factor.
void decode_pixels(ivec2 pixels[PIXELS], bool inside[PIXELS]) {
    WantedTexel wanted[PIXELS];
    bool covered[PIXELS];
    int adapters[PIXELS];
    float x[PIXELS][DECODER_INPUTS];
    bool any_wanted = false;
    for (int p = 0; p < PIXELS; ++p) {
        Surface surface = read_surface(pixels[p]);
        covered[p] = surface.material >= 0;
        wanted[p] = wanted_texel(surface);
        int id = max(wanted[p].texture_id, 0);
        adapters[p] = textures[id].adapter;
        if (wanted[p].texture_id >= 0 && inside[p]) {
            any_wanted = true;
            decoder_input(textures[id], wanted[p].uv, wanted[p].lod, wanted[p].wrap, x[p]);
        } else {
            for (int i = 0; i < DECODER_INPUTS; ++i) x[p][i] = 0.0;
        }
    }
    vec4 decoded[PIXELS];
    run_decoders(adapters, x, any_wanted ? network_blocks : 0, decoded);
    for (int p = 0; p < PIXELS; ++p) {
        if (!inside[p]) continue;
        vec3 shown = shown_albedo(wanted[p], clamp(decoded[p], 0.0, 1.0));
        imageStore(albedo, pixels[p], vec4(shown, covered[p] ? 1.0 : 0.0));
    }
}
