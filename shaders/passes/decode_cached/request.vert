#version 430
// Marks the tiles that visible pixels read without compute shaders: a point for each of them, at the tile's place in a picture of all.
#include "passes/decode_cached/tiles.glsl"

uniform ivec2 tiles_size;   // of that picture

// The tile that request number `number` of a pixel is for; -1 for none.
int wanted_tile(ivec2 pixel, int number) {
    Surface surface = read_surface(pixel);
    WantedTexel wanted = wanted_texel(surface);
    if (wanted.texture_id < 0) return -1;
    int first = material_tiles[surface.material];
    Probes probes = probes_of(pixel, wanted, materials[surface.material].planes[PLANE]);
    FilterLevels filtered = filter_levels(wanted.texture_id, probes.lod);
    if (number == 0) {
        int coarse = single_tile_level(wanted.texture_id);
        if (coarse <= filtered.lower) return -1;
        return tile_place(first, wanted, coarse, wrapped_place(wanted, vec2(0.0))).entry;
    }
    int probe = (number - 1) / 2;
    bool second = (number & 1) == 0;
    if (probe >= probes.count || (second && filtered.share <= 0.0)) return -1;
    vec2 uv = wrapped_place(wanted, probe_offset(probes, probe));
    return tile_place(first, wanted, second ? filtered.upper : filtered.lower, uv).entry;
}

void main() {
    ivec2 size = textureSize(surface_words, 0);
    int entry = wanted_tile(ivec2(gl_VertexID % size.x, gl_VertexID / size.x), gl_InstanceID);
    // Beyond the picture nothing is drawn.
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    if (entry >= 0) {
        vec2 place = vec2(entry % tiles_size.x, entry / tiles_size.x) + 0.5;
        gl_Position = vec4(place / vec2(tiles_size) * 2.0 - 1.0, 0.0, 1.0);
    }
}
