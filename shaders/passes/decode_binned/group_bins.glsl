// Adding pixels to bins. SHARED_SUMS 1: a bin gets one sum from each work group, not one from each pixel, for pixels side by side mostly
// have the same decoder. The group's own bins lie in shared memory; that costs barriers, which take long on a CPU.
#include "generated/layout.glsl"

#if SHARED_SUMS
const uint GROUP_PIXELS = uint(GROUP_SIDE * GROUP_SIDE);
const uint NO_BIN = 0xFFFFFFFFu;

shared uint group_bin[GROUP_PIXELS];      // decoder of each slot
shared uint group_count[GROUP_PIXELS];

// Adds this invocation's pixel (-1: none); returns its slot and its place there. There are as many slots as pixels: one is always found.
// Called by all invocations; after it all have been added.
uint add_to_group(int decoder, out uint slot) {
    uint own = gl_LocalInvocationIndex;
    group_bin[own] = NO_BIN;
    group_count[own] = 0u;
    barrier();
    uint place = 0u;
    slot = uint(max(decoder, 0)) % GROUP_PIXELS;
    if (decoder >= 0) {
        for (uint tries = 0u; tries < GROUP_PIXELS; ++tries) {
            uint found = atomicCompSwap(group_bin[slot], NO_BIN, uint(decoder));
            if (found == NO_BIN || found == uint(decoder)) break;
            slot = (slot + 1u) % GROUP_PIXELS;
        }
        place = atomicAdd(group_count[slot], 1u);
    }
    barrier();
    return place;
}
#endif
