/* Opens and decodes packs that were changed at random: whatever a file holds, libntc refuses it or decodes it.

   fuzz RUNS SEED PACK.ntc ...: built with sanitizers, which end the program at the first fault. Prints how many packs were opened. */
#include "ntc.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOST_PACKS 64
#define DECODED_SIDE 24

static uint64_t state;

static uint32_t random_below(uint32_t most) {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (uint32_t)((state >> 16) % most);
}

typedef struct {
    unsigned char *data;
    size_t bytes, header;
} seed;

static int read_seed(const char *name, seed *found) {
    FILE *file = fopen(name, "rb");
    if (file == NULL) return 0;
    fseek(file, 0, SEEK_END);
    found->bytes = (size_t)ftell(file);
    rewind(file);
    found->data = malloc(found->bytes);
    const size_t got = fread(found->data, 1, found->bytes, file);
    fclose(file);
    found->header = 8;
    for (int byte = 7; byte >= 0; --byte) found->header = byte == 7 ? found->data[byte] : found->header << 8 | found->data[byte];
    found->header += 8;
    return got == found->bytes;
}

/* A changed copy in memory of exactly its size, so that each read beyond it is found. */
static unsigned char *changed(const seed *from, const seed *other, size_t *bytes) {
    static const char *const words[] = {"0", "1", "-1", "65535", "4294967296", "99999999999999999999", "null", "[]", "{}", "\"\"",
                                        "1e999", "true", "\\u0000", "\\ud800", "\"grid\"", "\"block\"", "[[[[[[[[[["};
    size_t length = from->bytes;
    unsigned char *made = malloc(length + 64);
    memcpy(made, from->data, length);
    /* A part of the packs keeps its header and its length, so that more of it is decoded. */
    const int only_codes = random_below(2) && from->header < length;
    for (uint32_t round = 1 + random_below(4); round > 0; --round) {
        const size_t place = only_codes        ? from->header + random_below((uint32_t)(length - from->header))
                             : random_below(2) ? random_below((uint32_t)(from->header < length ? from->header : length))
                                               : random_below((uint32_t)length);
        switch (random_below(only_codes ? 2 : 7)) {
            case 0: made[place] = (unsigned char)random_below(256); break;
            case 1: made[place] ^= (unsigned char)(1u << random_below(8)); break;
            case 2: length = place + 1; break;
            case 3: made[place] = (unsigned char)('0' + random_below(10)); break;
            case 4: {
                const char *word = words[random_below(sizeof words / sizeof *words)];
                const size_t count = strlen(word);
                if (place + count <= length) memcpy(made + place, word, count);
                break;
            }
            case 5: {
                const size_t source = random_below((uint32_t)other->bytes), count = 1 + random_below(64);
                if (source + count <= other->bytes && place + count <= length) memcpy(made + place, other->data + source, count);
                break;
            }
            default: {
                const size_t count = 1 + random_below(8);
                if (place + count < length) {
                    memmove(made + place, made + place + count, length - place - count);
                    length -= count;
                }
            }
        }
    }
    unsigned char *exact = malloc(length);
    memcpy(exact, made, length);
    free(made);
    *bytes = length;
    return exact;
}

static int smaller(int a, int b) {
    return a < b ? a : b;
}

static void decode_some(const ntc_pack *pack) {
    static unsigned char texels[DECODED_SIDE * DECODED_SIDE * NTC_MOST_CHANNELS * 4];
    for (int number = 0; number < smaller(ntc_texture_count(pack), 4); ++number) {
        ntc_texture_info info;
        ntc_texture(pack, number, &info);
        const int mip = (int)random_below((uint32_t)info.mips);
        const int width = info.width >> mip > 0 ? info.width >> mip : 1, height = info.height >> mip > 0 ? info.height >> mip : 1;
        const int across = smaller(width, DECODED_SIDE), down = smaller(height, DECODED_SIDE);
        const ntc_type type = random_below(2) ? NTC_U8 : NTC_F32;
        const size_t row = (size_t)across * (size_t)info.channels * (type == NTC_U8 ? 1 : 4);
        ntc_decode(pack, number, mip, width - across, height - down, across, down, type, texels, row);
    }
}

int main(int count, char **arguments) {
    seed seeds[MOST_PACKS];
    int packs = 0;
    long opened = 0;
    const long runs = count > 1 ? atol(arguments[1]) : 0;
    state = count > 2 ? strtoull(arguments[2], NULL, 10) * 2654435761u + 88172645463325252u : 1;
    for (int number = 3; number < count && packs < MOST_PACKS; ++number) packs += read_seed(arguments[number], &seeds[packs]);
    if (packs == 0) return 2;
    for (long run = 0; run < runs; ++run) {
        size_t bytes;
        ntc_pack *pack;
        ntc_error error;
        unsigned char *data = changed(&seeds[random_below((uint32_t)packs)], &seeds[random_below((uint32_t)packs)], &bytes);
        if (ntc_open(data, bytes, NULL, &pack, &error) == NTC_OK) {
            ++opened;
            decode_some(pack);
            ntc_close(pack);
        } else if (error.text[0] == 0) {
            return 3;
        }
        free(data);
    }
    for (int number = 0; number < packs; ++number) free(seeds[number].data);
    printf("%ld of %ld opened\n", opened, runs);
    return 0;
}
