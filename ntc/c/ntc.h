/* libntc: reads ntc-viewer's packs (.ntc) and decodes their textures, to texels or to BC7, BC5 and BC4.

   C99, without dependencies. Build it from ntc.h and ntc.c alone. A pack is immutable once it is open: all functions that take a
   `const ntc_pack *` may run in several threads at once. Files are untrusted: ntc_open checks everything and reports what is wrong.

   The formats are specified in docs/reference/pack-format.md, codec-block.md and codec-grid.md. */
#ifndef NTC_H
#define NTC_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define NTC_MOST_MAPS 7
#define NTC_MOST_CHANNELS 13

typedef enum {
    NTC_OK = 0,
    NTC_NO_MEMORY,       /* the allocator returned NULL */
    NTC_BAD_FILE,        /* the file is damaged, or no pack; ntc_error has the reason */
    NTC_UNSUPPORTED,     /* a codec, format or grouping that this version does not decode */
    NTC_BAD_ARGUMENT     /* a texture, mip, map or rectangle that does not exist */
} ntc_status;

/* Maps of a texture, in the order of its channels (docs/reference/codecs.md). */
typedef enum { NTC_BASE, NTC_NORMAL, NTC_ROUGHNESS, NTC_METALNESS, NTC_EMISSIVE, NTC_OCCLUSION, NTC_ALPHA } ntc_map;

typedef enum { NTC_REPEAT, NTC_MIRROR, NTC_CLAMP } ntc_wrap;

typedef enum {
    NTC_U8,     /* values 0 to 255, as stored: sRGB for base and emissive */
    NTC_F32     /* the same values in [0, 1], not rounded */
} ntc_type;

/* Formats of graphics hardware: blocks of 4x4 texels. */
typedef enum {
    NTC_BC4,    /* 8 bytes: one channel */
    NTC_BC5,    /* 16 bytes: two channels, such as x and y of normals */
    NTC_BC7,    /* 16 bytes: colours; a fourth channel is alpha, which is 255 without one */
    NTC_BC4_QUICK,  /* the same formats, for loading: several times faster, at a somewhat larger error */
    NTC_BC5_QUICK,
    NTC_BC7_QUICK
} ntc_block_format;

typedef struct {
    void *(*allocate)(size_t bytes, void *user);      /* NULL: malloc. Returns memory aligned for any type, or NULL */
    void (*release)(void *memory, void *user);        /* NULL: free */
    void *user;
    const void *tables;                               /* shipped tables, for packs of grouping `universal`: universal_2_*.safetensors, or of
                                                         whole materials universal_sets_*.safetensors. They must not change until ntc_close */
    size_t tables_bytes;
} ntc_options;

typedef struct {
    char text[200];    /* one line */
} ntc_error;

typedef struct ntc_pack ntc_pack;

typedef struct {
    const char *name;            /* UTF-8 */
    const char *pixel_hash;      /* identity of the original image */
    int width, height;           /* of mip 0, in texels */
    int mips;
    int channels;                /* of all maps together */
    int map_count;
    ntc_map maps[NTC_MOST_MAPS];
    int map_channels[NTC_MOST_MAPS];
    int is_srgb;                 /* whether base colours are sRGB values */
    ntc_wrap wrap[2];            /* along u and v */
} ntc_texture_info;

/* Opens the pack in `data`, which must not change until ntc_close. `options` and `error` may be NULL. */
ntc_status ntc_open(const void *data, size_t bytes, const ntc_options *options, ntc_pack **pack, ntc_error *error);
void ntc_close(ntc_pack *pack);

int ntc_texture_count(const ntc_pack *pack);
ntc_status ntc_texture(const ntc_pack *pack, int texture, ntc_texture_info *info);
/* Returns the index of the texture with that pixel hash, or -1. */
int ntc_find(const ntc_pack *pack, const char *pixel_hash);

/* Decodes a rectangle of a mip, row 0 at v = 0: `channels` values per texel, all maps side by side. `row_bytes` is the stride of rows
   in `texels`. */
ntc_status ntc_decode(const ntc_pack *pack, int texture, int mip, int x, int y, int width, int height, ntc_type type, void *texels,
                      size_t row_bytes);

/* Decodes one map of a whole mip and compresses it. `row_bytes` is the stride of rows of blocks; texels beyond the edge repeat it. */
ntc_status ntc_decode_blocks(const ntc_pack *pack, int texture, int mip, ntc_map map, ntc_block_format format, void *blocks,
                             size_t row_bytes);

/* Compresses 4x4 texels of RGBA. BC4 takes the first channel, BC5 the first two. Returns the number of bytes written: 8 or 16. */
int ntc_compress(const uint8_t texels[64], ntc_block_format format, uint8_t *block);

#ifdef __cplusplus
}
#endif
#endif
