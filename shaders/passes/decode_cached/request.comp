#version 430
// Marks the pages that visible pixels read as used, and lists missing tiles (passes/decode_cached/tiles.glsl explains the page table).
layout(local_size_x = 8, local_size_y = 8) in;
#include "passes/decode_cached/tiles.glsl"

layout(std430, binding = BINDING_PAGE_USED) writeonly buffer PageUsed {
    uint page_used[];   // last frame that read each page
};
layout(std430, binding = BINDING_RESULTS) buffer Requests {
    uint request_count;
    uint requests[];   // indices into tile_entries
};
uniform uint frame;
uniform uint most_requests;   // capacity of the list

// Returns whether a tile is resident; if not, requests it.
bool request_tile(int entry) {
    uint page = tile_entries[entry];
    if (is_resident(page)) {
        page_used[page - 1u] = frame;
        return true;
    }
    // Only the first pixel that needs a tile appends it to the list.
    if (page == 0u && atomicCompSwap(tile_entries[entry], 0u, TILE_REQUESTED) == 0u) {
        uint place = atomicAdd(request_count, 1u);
        if (place < most_requests) requests[place] = uint(entry);
        else tile_entries[entry] = 0u;
    }
    return false;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, textureSize(surface_words, 0)))) return;
    Surface surface = read_surface(pixel);
    WantedTexel wanted = wanted_texel(surface);
    if (wanted.texture_id < 0) return;
    int first = material_tiles[surface.material];
    Probes probes = probes_of(pixel, wanted, materials[surface.material].planes[PLANE]);
    FilterLevels filtered = filter_levels(wanted.texture_id, probes.lod);
    bool complete = true;
    for (int number = 0; number < probes.count; ++number) {
        vec2 uv = wrapped_place(wanted, probe_offset(probes, number));
        complete = request_tile(tile_place(first, wanted, filtered.lower, uv).entry) && complete;
        if (filtered.share > 0.0)
            complete = request_tile(tile_place(first, wanted, filtered.upper, uv).entry) && complete;
    }
    int coarse = single_tile_level(wanted.texture_id);
    if (!complete && coarse > filtered.lower)
        request_tile(tile_place(first, wanted, coarse, wrapped_place(wanted, vec2(0.0))).entry);
}
