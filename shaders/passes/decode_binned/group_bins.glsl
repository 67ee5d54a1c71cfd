// Adding pixels to bins. SHARED_SUMS 1: each work group first counts its pixels by decoder in a hash table in shared memory, and then adds
// one sum per decoder to the bins. This saves atomics, because neighbouring pixels mostly have the same decoder. Its barriers are slow on a CPU.
#include "generated/layout.glsl"

#if SHARED_SUMS
const uint GROUP_PIXELS = uint(GROUP_SIDE * GROUP_SIDE);
const uint NO_BIN = 0xFFFFFFFFu;

shared uint group_bin[GROUP_PIXELS];      // decoder of each slot
shared uint group_count[GROUP_PIXELS];

// Adds this invocation's pixel with `decoder` (-1: none). Returns its rank in its slot, and the slot. There are as many slots as pixels, so
// probing always ends. All invocations must call it; then all pixels have been added.
uint add_to_group(int decoder, out uint slot) {
    uint lane = gl_LocalInvocationIndex;
    group_bin[lane] = NO_BIN;
    group_count[lane] = 0u;
    barrier();
    uint place = 0u;
    slot = uint(max(decoder, 0)) % GROUP_PIXELS;
    if (decoder >= 0) {
        for (uint tries = 0u; tries < GROUP_PIXELS; ++tries) {
            uint holder = atomicCompSwap(group_bin[slot], NO_BIN, uint(decoder));
            if (holder == NO_BIN || holder == uint(decoder)) break;
            slot = (slot + 1u) % GROUP_PIXELS;
        }
        place = atomicAdd(group_count[slot], 1u);
    }
    barrier();
    return place;
}
#endif
