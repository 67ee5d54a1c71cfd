/* Writes all texels of a pack as 8-bit values: textures in order, of each its mips from the finest, rows from v = 0.

   dump PACK.ntc [TABLES.safetensors]: to the standard output. Exit status 1, with one line, for a pack that cannot be read. */
#include "ntc.h"

#include <stdio.h>
#include <stdlib.h>

static unsigned char *read_all(const char *name, size_t *bytes) {
    FILE *file = fopen(name, "rb");
    unsigned char *data = NULL;
    size_t room = 0, got;
    *bytes = 0;
    if (file == NULL) return NULL;
    do {
        if (*bytes == room) data = realloc(data, room = room == 0 ? 65536 : 2 * room);
        if (data == NULL) return NULL;
        got = fread(data + *bytes, 1, room - *bytes, file);
        *bytes += got;
    } while (got > 0);
    fclose(file);
    return data;
}

int main(int count, char **arguments) {
    ntc_options options = {0};
    ntc_error error;
    ntc_pack *pack;
    size_t bytes;
    unsigned char *data = count > 1 ? read_all(arguments[1], &bytes) : NULL;
    if (count > 2) options.tables = read_all(arguments[2], &options.tables_bytes);
    if (data == NULL || ntc_open(data, bytes, &options, &pack, &error) != NTC_OK) {
        fprintf(stderr, "%s\n", data == NULL ? "the file cannot be read" : error.text);
        return 1;
    }
    for (int number = 0; number < ntc_texture_count(pack); ++number) {
        ntc_texture_info info;
        ntc_texture(pack, number, &info);
        for (int mip = 0; mip < info.mips; ++mip) {
            const int width = info.width >> mip > 0 ? info.width >> mip : 1, height = info.height >> mip > 0 ? info.height >> mip : 1;
            const size_t row = (size_t)width * (size_t)info.channels;
            unsigned char *texels = malloc(row * (size_t)height);
            if (texels == NULL || ntc_decode(pack, number, mip, 0, 0, width, height, NTC_U8, texels, row) != NTC_OK) return 1;
            fwrite(texels, 1, row * (size_t)height, stdout);
            free(texels);
        }
    }
    ntc_close(pack);
    free(data);
    return 0;
}
