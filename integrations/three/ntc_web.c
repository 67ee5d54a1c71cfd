/* libntc as a WebAssembly module. It has one open pack, and decodes whole mips to RGBA8 or to blocks for the GPU. worker.js calls it. */
#include "ntc.h"

#include <math.h>
#include <stdlib.h>

#define EXPORT(name) __attribute__((export_name(name)))
#define STRIP 32      /* rows of texels that are decoded at a time: a multiple of 4 */
#define FILLED (-1)   /* a channel: of `fill`, or 255 without it */
#define NORMAL_Z (-2) /* a channel: z of a unit normal, from the first two components */
#define RGBA8 (-1)    /* format; others are those of ntc_block_format */

/* An image to make of a mip, laid out as worker.js writes it. */
typedef struct {
    int32_t channels[4];    /* channel of the texture for each component */
    int32_t format;
    const uint8_t *fill;    /* RGBA8 of the mip, or NULL */
    uint8_t *out;
} output;

static ntc_pack *pack;
static ntc_error error;

EXPORT("allocate") void *allocate(size_t bytes) {
    return malloc(bytes);
}

EXPORT("release") void release(void *memory) {
    free(memory);
}

/* Opens the pack in `data`, and closes the previous one. */
EXPORT("open") int open_pack(const void *data, size_t bytes, const void *tables, size_t tables_bytes) {
    ntc_options options = {0};
    ntc_close(pack);
    options.tables = tables_bytes > 0 ? tables : NULL;
    options.tables_bytes = tables_bytes;
    return (int)ntc_open(data, bytes, &options, &pack, &error);
}

EXPORT("error") const char *error_text(void) {
    return error.text;
}

EXPORT("textures") int textures(void) {
    return ntc_texture_count(pack);
}

/* Writes width, height, mips, channels, and the address of the pixel hash. */
EXPORT("texture") void texture(int number, int32_t *facts) {
    ntc_texture_info info;
    ntc_texture(pack, number, &info);
    facts[0] = info.width;
    facts[1] = info.height;
    facts[2] = info.mips;
    facts[3] = info.channels;
    facts[4] = (int32_t)(intptr_t)info.pixel_hash;
}

static uint8_t normal_z(const uint8_t *texel) {
    const float x = (float)texel[0] / 127.5f - 1.0f, y = (float)texel[1] / 127.5f - 1.0f, square = 1.0f - x * x - y * y;
    return (uint8_t)((square > 0.0f ? sqrtf(square) : 0.0f) * 127.5f + 128.0f);
}

static void compose(const output *made, const uint8_t *texel, size_t place, uint8_t *rgba) {
    for (int component = 0; component < 4; ++component) {
        const int channel = made->channels[component];
        if (channel >= 0) rgba[component] = texel[channel];
        else if (channel == NORMAL_Z) rgba[component] = normal_z(rgba);
        else rgba[component] = made->fill != NULL ? made->fill[4 * place + (size_t)component] : 255;
    }
}

/* Writes `rows` rows of a mip, from row `top` on, from `texels` to `made`. Blocks repeat the last texel beyond the edge. */
static void write_rows(const output *made, const uint8_t *texels, int channels, int width, int top, int rows) {
    uint8_t block[64], *out;
    if (made->format == RGBA8) {
        for (size_t at = 0; at < (size_t)rows * (size_t)width; ++at) {
            const size_t place = (size_t)top * (size_t)width + at;
            compose(made, texels + at * (size_t)channels, place, made->out + 4 * place);
        }
        return;
    }
    out = made->out + (size_t)(top / 4) * (size_t)((width + 3) / 4) * (made->format == NTC_BC4 || made->format == NTC_BC4_QUICK ? 8u : 16u);
    for (int y = 0; y < rows; y += 4) {
        for (int x = 0; x < width; x += 4) {
            for (int texel = 0; texel < 16; ++texel) {
                const int row = y + texel / 4 < rows ? y + texel / 4 : rows - 1;
                const int column = x + texel % 4 < width ? x + texel % 4 : width - 1;
                const size_t at = (size_t)row * (size_t)width + (size_t)column;
                compose(made, texels + at * (size_t)channels, (size_t)top * (size_t)width + at, block + 4 * texel);
            }
            out += ntc_compress(block, (ntc_block_format)made->format, out);
        }
    }
}

/* Decodes a mip once, and writes it to all `outputs`. Returns an ntc_status. */
EXPORT("decode") int decode(int number, int mip, const output *outputs, int count) {
    ntc_texture_info info;
    ntc_status status = ntc_texture(pack, number, &info);
    if (status != NTC_OK) return (int)status;
    const int width = info.width >> mip > 0 ? info.width >> mip : 1, height = info.height >> mip > 0 ? info.height >> mip : 1;
    const size_t row_bytes = (size_t)width * (size_t)info.channels;
    uint8_t *texels = malloc(row_bytes * STRIP);
    if (texels == NULL) return (int)NTC_NO_MEMORY;
    for (int top = 0; top < height && status == NTC_OK; top += STRIP) {
        const int rows = height - top < STRIP ? height - top : STRIP;
        status = ntc_decode(pack, number, mip, 0, top, width, rows, NTC_U8, texels, row_bytes);
        for (int place = 0; place < count && status == NTC_OK; ++place) {
            write_rows(&outputs[place], texels, info.channels, width, top, rows);
        }
    }
    free(texels);
    return (int)status;
}
