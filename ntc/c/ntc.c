/* libntc (see ntc.h): reading pack files, decoding codec `block` (format 2) and codec `grid`, compressing to BC4, BC5 and BC7. */
#include "ntc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MOST_TEXTURES 65535
#define LARGEST_SIDE 32768
#define MOST_LEVELS 16
#define LARGEST_DEPTH 7
#define MOST_CLASSES 4
#define MOST_PLANES 4
#define TABLE_PLANES 3      /* planes of shipped tables: all but coverage */
#define TABLE_CHANNELS 12   /* channels of shipped tables: all maps but alpha; base colour has four */
#define BLOCK_VALUES 64
#define DIRECTORY_RUN 16
#define DEEPEST_JSON 64

/* ---- Little-endian bytes, memory, errors ---- */

static uint32_t u32_at(const uint8_t *bytes) {
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static float f32_at(const uint8_t *bytes) {
    uint32_t bits = u32_at(bytes);
    float number;
    memcpy(&number, &bits, 4);
    return number;
}

static float f16_at(const uint8_t *bytes) {
    uint32_t half = (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8;
    uint32_t exponent = half >> 10 & 31u, fraction = half & 1023u;
    float size = exponent == 0 ? (float)fraction * 5.9604644775390625e-8f : 0.0f;
    if (exponent != 0) {
        uint32_t bits = (exponent + 112u) << 23 | fraction << 13;
        if (exponent == 31u) bits = 0x7F800000u | fraction << 13;
        memcpy(&size, &bits, 4);
    }
    return half & 0x8000u ? -size : size;
}

static int is_finite_number(float number) {
    return number - number == 0.0f;
}

static void *default_allocate(size_t bytes, void *user) {
    (void)user;
    return malloc(bytes);
}

static void default_release(void *memory, void *user) {
    (void)user;
    free(memory);
}

/* Memory of a pack: a list of pieces, which are released together. */
typedef struct piece {
    struct piece *next;
} piece;

typedef struct {
    ntc_options options;
    piece *pieces;
} memory;

/* Allocates zeroed memory for `count` elements of `bytes` bytes. Returns NULL if there is none. */
static void *take(memory *pool, size_t count, size_t bytes) {
    const size_t head = 16;
    if (bytes != 0 && count > (SIZE_MAX - head) / bytes) return NULL;
    piece *made = (piece *)pool->options.allocate(head + count * bytes, pool->options.user);
    if (made == NULL) return NULL;
    memset(made, 0, head + count * bytes);
    made->next = pool->pieces;
    pool->pieces = made;
    return (char *)made + head;
}

static void release_all(memory *pool) {
    while (pool->pieces != NULL) {
        piece *first = pool->pieces;
        pool->pieces = first->next;
        pool->options.release(first, pool->options.user);
    }
}

static ntc_status fail(ntc_error *error, ntc_status status, const char *text) {
    if (error != NULL) {
        strncpy(error->text, text, sizeof error->text - 1);
        error->text[sizeof error->text - 1] = 0;
    }
    return status;
}

/* ---- JSON: values are ranges of text; unknown members are skipped ---- */

typedef struct {
    const char *at, *end;
} text;

static void skip_space(text *json) {
    while (json->at < json->end && (*json->at == ' ' || *json->at == '\n' || *json->at == '\t' || *json->at == '\r')) ++json->at;
}

static int next_is(text *json, char wanted) {
    skip_space(json);
    if (json->at >= json->end || *json->at != wanted) return 0;
    ++json->at;
    return 1;
}

/* Reads a string without its quotes; escapes are not decoded. */
static int read_string(text *json, text *result) {
    if (!next_is(json, '"')) return 0;
    result->at = json->at;
    while (json->at < json->end && *json->at != '"') {
        if ((unsigned char)*json->at < 32) return 0;
        if (*json->at == '\\' && ++json->at >= json->end) return 0;
        ++json->at;
    }
    if (json->at >= json->end) return 0;
    result->end = json->at++;
    return 1;
}

/* Skips a value of any kind, with at most `depth` nested arrays and objects. `result` is its text. */
static int skip_value(text *json, int depth, text *result) {
    text ignored;
    skip_space(json);
    result->at = json->at;
    if (json->at >= json->end || depth <= 0) return 0;
    if (*json->at == '"') {
        if (!read_string(json, &ignored)) return 0;
    } else if (*json->at == '{' || *json->at == '[') {
        const int is_object = *json->at == '{';
        const char closing = is_object ? '}' : ']';
        ++json->at;
        if (!next_is(json, closing)) {
            do {
                if (is_object && !(read_string(json, &ignored) && next_is(json, ':'))) return 0;
                if (!skip_value(json, depth - 1, &ignored)) return 0;
            } while (next_is(json, ','));
            if (!next_is(json, closing)) return 0;
        }
    } else {
        while (json->at < json->end && strchr("+-.0123456789eEtrufalsn", *json->at) != NULL && *json->at != 0) ++json->at;
        if (json->at == result->at) return 0;
    }
    result->end = json->at;
    return 1;
}

static int is_text(text value, const char *wanted) {
    size_t length = strlen(wanted);
    return (size_t)(value.end - value.at) == length && memcmp(value.at, wanted, length) == 0;
}

/* Reads the next member of an object whose brace has been read. Returns 1, 0 at the end of the object, -1 for invalid JSON.
   `first` must be 1 before the first call. */
static int next_member(text *json, int *first, text *name, text *value) {
    if (next_is(json, '}')) return 0;
    if (!*first && !next_is(json, ',')) return -1;
    *first = 0;
    return read_string(json, name) && next_is(json, ':') && skip_value(json, DEEPEST_JSON, value) ? 1 : -1;
}

static int next_element(text *json, int *first, text *value) {
    if (next_is(json, ']')) return 0;
    if (!*first && !next_is(json, ',')) return -1;
    *first = 0;
    return skip_value(json, DEEPEST_JSON, value) ? 1 : -1;
}

/* Finds a member of `object`. Returns 0 if it has none, or is no object. If a name occurs several times, the last one counts. */
static int member(text object, const char *wanted, text *result) {
    text name, value;
    int first = 1, state, is_there = 0;
    if (!next_is(&object, '{')) return 0;
    while ((state = next_member(&object, &first, &name, &value)) == 1) {
        if (is_text(name, wanted)) {
            *result = value;
            is_there = 1;
        }
    }
    return state == 0 && is_there;
}

/* Reads a whole number from 0 to `most`. */
static int whole(text value, uint64_t most, uint64_t *result) {
    uint64_t number = 0;
    if (value.at >= value.end) return 0;
    for (; value.at < value.end; ++value.at) {
        if (*value.at < '0' || *value.at > '9') return 0;
        if (number > (UINT64_MAX - 9) / 10) return 0;
        number = number * 10 + (uint64_t)(*value.at - '0');
    }
    *result = number;
    return number <= most;
}

static int whole_member(text object, const char *name, int least, int most, int *result) {
    text value;
    uint64_t number;
    if (!member(object, name, &value) || !whole(value, (uint64_t)most, &number) || (int)number < least) return 0;
    *result = (int)number;
    return 1;
}

static int bare_string(text value, text *result) {
    return read_string(&value, result) && value.at == value.end;
}

static int hex_digits(const char *at, uint32_t *result) {
    uint32_t code = 0;
    for (int digit = 0; digit < 4; ++digit) {
        char c = at[digit];
        uint32_t value = c >= '0' && c <= '9'   ? (uint32_t)(c - '0')
                       : c >= 'a' && c <= 'f' ? (uint32_t)(c - 'a' + 10)
                       : c >= 'A' && c <= 'F' ? (uint32_t)(c - 'A' + 10)
                                              : 16u;
        if (value > 15u) return 0;
        code = code << 4 | value;
    }
    *result = code;
    return 1;
}

/* Returns the string `value` with escapes decoded, as UTF-8 with a final 0; NULL without memory, or for an invalid escape. */
static char *unescaped(memory *pool, text value, size_t *length) {
    char *made = (char *)take(pool, (size_t)(value.end - value.at) + 1, 1);
    char *out = made;
    if (made == NULL) return NULL;
    while (value.at < value.end) {
        if (*value.at != '\\') {
            *out++ = *value.at++;
            continue;
        }
        char kind = value.at[1];
        value.at += 2;
        if (kind == 'u') {
            uint32_t code, low;
            if (value.end - value.at < 4 || !hex_digits(value.at, &code)) return NULL;
            value.at += 4;
            if (code >= 0xD800u && code < 0xDC00u && value.end - value.at >= 6 && value.at[0] == '\\' && value.at[1] == 'u' &&
                hex_digits(value.at + 2, &low) && low >= 0xDC00u && low < 0xE000u) {
                code = 0x10000u + ((code - 0xD800u) << 10) + (low - 0xDC00u);
                value.at += 6;
            }
            if (code == 0 || (code >= 0xD800u && code < 0xE000u)) return NULL;
            if (code < 0x80u) {
                *out++ = (char)code;
            } else if (code < 0x800u) {
                *out++ = (char)(0xC0u | code >> 6);
                *out++ = (char)(0x80u | (code & 63u));
            } else if (code < 0x10000u) {
                *out++ = (char)(0xE0u | code >> 12);
                *out++ = (char)(0x80u | (code >> 6 & 63u));
                *out++ = (char)(0x80u | (code & 63u));
            } else {
                *out++ = (char)(0xF0u | code >> 18);
                *out++ = (char)(0x80u | (code >> 12 & 63u));
                *out++ = (char)(0x80u | (code >> 6 & 63u));
                *out++ = (char)(0x80u | (code & 63u));
            }
        } else {
            static const char from[] = "\"\\/bfnrt", to[] = "\"\\/\b\f\n\r\t";
            const char *place = kind != 0 ? strchr(from, kind) : NULL;
            if (place == NULL) return NULL;
            *out++ = to[place - from];
        }
    }
    *length = (size_t)(out - made);
    return made;
}

/* ---- The data of a pack ---- */

typedef enum { U8, I8, F16, F32 } tensor_type;

typedef struct {
    const uint8_t *data;    /* NULL: missing */
    uint64_t begin, end;
    uint64_t shape[3];
    int dimensions;
    tensor_type type;
} tensor;

enum { WORDS, MEAN, AXES, SCALE, OFFSET, ADAPTER_SCALES, ADAPTER_BIASES, ADAPTER_WEIGHT, ADAPTER_BIAS, TEXTURE_TENSORS };
static const char *const TEXTURE_NAMES[TEXTURE_TENSORS] = {
    "latents", "latents.mean", "latents.axes", "latents.scale", "latents.offset", "adapter.scales", "adapter.biases",
    "adapter.output.weight", "adapter.output.bias"};
enum {
    BASIS, CHANNELS, BASIS_SCALE, SCALES, EDGES, WEIGHT_0, BIAS_0, WEIGHT_1, BIAS_1, WEIGHT_2, BIAS_2, GAINS, DECODER_TENSORS
};
static const char *const DECODER_NAMES[DECODER_TENSORS] = {
    "decoder.basis", "decoder.channels", "decoder.basis_scale", "decoder.scales", "decoder.edges", "decoder.0.weight",
    "decoder.0.bias", "decoder.1.weight", "decoder.1.bias", "decoder.2.weight", "decoder.2.bias", "decoder.gains"};

typedef struct {
    int width, height;              /* in cells or blocks */
    int texel_width, texel_height;
    int mip_of_cell;
    uint64_t first;                 /* word or cell of the level in the texture's latents */
} level;

typedef struct {
    ntc_texture_info info;
    int group;
    int places[NTC_MOST_CHANNELS];    /* channel of the codec for each channel of the texture */
    uint32_t srgb_channels;           /* a bit for each channel of the codec whose values are sRGB-coded */
    tensor tensors[TEXTURE_TENSORS];
    level levels[MOST_LEVELS];
} texture;

typedef struct {
    uint16_t coefficient;
    uint8_t depth;
} active;

typedef struct {
    int first_branch;       /* bits before the first branch bit */
    int has_edges;
    int count;
    const active *list;
} code_layout;

typedef struct {
    tensor tensors[DECODER_TENSORS];
    float *rows[4];              /* block: by mip of a code, [coefficients][texels of the mip] */
    code_layout *layouts;        /* block: [classes][modes] */
    float *weights[3];           /* grid: by layer, [inputs][outputs] */
    float *biases[3];
} decoder;

typedef struct {
    int is_grid;
    int channels;
    uint32_t maps;                        /* a bit for each map */
    int base_channels;
    int plane_count;
    int plane_first[MOST_PLANES], plane_channels[MOST_PLANES];
    int plane_list[MOST_PLANES][NTC_MOST_CHANNELS];
    int levels;                           /* 0: all */
    /* block */
    int mips, side, classes, coefficients, modes, mode_bits;
    int tables;                           /* version of the shipped tables that decoders scale by gains; 0: the pack stores tables */
    int words[MOST_CLASSES];
    /* grid */
    int latent_channels, latent_bits, downscale, octaves, hidden, weight_bits, adapters, adapter_output, inputs;
    float leaky_slope;
} settings;

struct ntc_pack {
    memory memory;
    settings settings;
    int texture_count, decoder_count;
    texture *textures;
    decoder *decoders;
    float powers[512];                    /* 2^((i - 384) / 16) */
};

static const int MAP_CHANNELS[NTC_MOST_MAPS] = {3, 2, 1, 1, 3, 1, 1};
static const int MAP_PLANES[NTC_MOST_MAPS] = {0, 1, 1, 1, 2, 2, 3};
static const char *const MAP_NAMES[NTC_MOST_MAPS] = {"base", "normal", "roughness", "metalness", "emissive", "occlusion",
                                                        "alpha"};

/* ---- Reading tensors ---- */

/* Returns whether `name` is `pattern` with a number after its first word: "latents.12.mean" for "latents.mean". */
static int numbered(text name, const char *pattern, uint64_t *number) {
    const char *at = name.at;
    text digits;
    while (at < name.end && *pattern != 0 && *pattern != '.') {
        if (*at++ != *pattern++) return 0;
    }
    if (at >= name.end || *at++ != '.' || *pattern == 0 ? at > name.end || *pattern != 0 : *pattern != '.') return 0;
    digits.at = at;
    while (at < name.end && *at >= '0' && *at <= '9') ++at;
    digits.end = at;
    if (digits.at == digits.end || (*digits.at == '0' && digits.end - digits.at > 1)) return 0;
    if (digits.end - digits.at > 9 || !whole(digits, MOST_TEXTURES, number)) return 0;
    return (size_t)(name.end - at) == strlen(pattern) && memcmp(at, pattern, strlen(pattern)) == 0;
}

static int read_tensor(text value, uint64_t data_bytes, const uint8_t *data, tensor *result) {
    static const int bytes_of[] = {1, 1, 2, 4};
    text part, name, element;
    int first = 1, state;
    uint64_t count = 1, place[2] = {0, 0};
    if (!member(value, "dtype", &part) || !bare_string(part, &name)) return 0;
    if (is_text(name, "U8")) result->type = U8;
    else if (is_text(name, "I8")) result->type = I8;
    else if (is_text(name, "F16")) result->type = F16;
    else if (is_text(name, "F32")) result->type = F32;
    else return 0;
    if (!member(value, "shape", &part) || !next_is(&part, '[')) return 0;
    result->dimensions = 0;
    while ((state = next_element(&part, &first, &element)) == 1) {
        uint64_t size;
        if (result->dimensions == 3 || !whole(element, (uint64_t)1 << 33, &size)) return 0;
        if (size != 0 && count > UINT64_MAX / size) return 0;
        count *= size;
        result->shape[result->dimensions++] = size;
    }
    if (state != 0 || !member(value, "data_offsets", &part) || !next_is(&part, '[')) return 0;
    first = 1;
    for (int end = 0; end < 2; ++end) {
        if (next_element(&part, &first, &element) != 1 || !whole(element, data_bytes, &place[end])) return 0;
    }
    if (next_element(&part, &first, &element) != 0 || place[1] < place[0]) return 0;
    if (count > UINT64_MAX / 4 || place[1] - place[0] != count * (uint64_t)bytes_of[result->type]) return 0;
    result->begin = place[0];
    result->end = place[1];
    result->data = data + place[0];
    return 1;
}

static int has_shape(const tensor *part, tensor_type type, int dimensions, uint64_t first, uint64_t second) {
    if (part->data == NULL || part->type != type || part->dimensions != dimensions) return 0;
    return part->shape[0] == first && (dimensions < 2 || part->shape[1] == second);
}

/* Returns whether all numbers are finite. If `largest` is above 0, their magnitudes must not exceed it. */
static int has_numbers(const tensor *part, float largest) {
    uint64_t bytes = part->type == F32 ? 4 : 2;
    for (uint64_t at = part->begin; at < part->end; at += bytes) {
        const uint8_t *number = part->data + (at - part->begin);
        float value = part->type == F32 ? f32_at(number) : f16_at(number);
        if (!is_finite_number(value) || (largest > 0.0f && !(fabsf(value) <= largest))) return 0;
    }
    return 1;
}

typedef struct {
    const uint8_t *data;      /* bytes after the header */
    uint64_t data_bytes;
    text header;
} container;

static int open_container(const void *data, size_t bytes, container *file) {
    const uint8_t *at = (const uint8_t *)data;
    if (data == NULL || bytes < 10) return 0;
    uint64_t length = (uint64_t)u32_at(at) | (uint64_t)u32_at(at + 4) << 32;
    if (length > bytes - 8 || length < 2) return 0;
    file->header.at = (const char *)at + 8;
    file->header.end = file->header.at + length;
    file->data = at + 8 + length;
    file->data_bytes = bytes - 8 - length;
    return 1;
}

typedef struct {
    uint64_t begin, end;
} range;

static int by_begin(const void *first, const void *second) {
    const range *a = (const range *)first, *b = (const range *)second;
    if (a->begin != b->begin) return a->begin < b->begin ? -1 : 1;
    return a->end < b->end ? -1 : a->end > b->end;
}

/* Reads the tensors of a container. Each byte of the data must belong to exactly one tensor. Returns an error, or NULL. */
static const char *read_tensors(ntc_pack *pack, const container *file) {
    text header = file->header, name, value;
    int first = 1, state;
    size_t most = (size_t)pack->texture_count * TEXTURE_TENSORS + (size_t)pack->decoder_count * DECODER_TENSORS, count = 0;
    range *ranges = (range *)take(&pack->memory, most + 1, sizeof(range));
    if (ranges == NULL) return "";
    if (!next_is(&header, '{')) return "the header is not JSON";
    while ((state = next_member(&header, &first, &name, &value)) == 1) {
        tensor *place = NULL;
        uint64_t number;
        if (is_text(name, "__metadata__")) continue;
        for (int part = 0; part < TEXTURE_TENSORS && place == NULL; ++part) {
            if (numbered(name, TEXTURE_NAMES[part], &number) && number < (uint64_t)pack->texture_count)
                place = &pack->textures[number].tensors[part];
        }
        for (int part = 0; part < DECODER_TENSORS && place == NULL; ++part) {
            if (numbered(name, DECODER_NAMES[part], &number) && number < (uint64_t)pack->decoder_count)
                place = &pack->decoders[number].tensors[part];
        }
        if (place == NULL) return "a tensor does not belong there";
        if (place->data != NULL) return "a tensor is there twice";
        if (!read_tensor(value, file->data_bytes, file->data, place)) return "a tensor has no valid type, shape or place";
        if ((place->type == F16 || place->type == F32) && !has_numbers(place, 0.0f)) return "a tensor holds NaN or infinity";
        ranges[count].begin = place->begin;
        ranges[count++].end = place->end;
    }
    skip_space(&header);
    if (state != 0 || header.at != header.end) return "the header is not JSON";
    qsort(ranges, count, sizeof(range), by_begin);
    uint64_t covered = 0;
    for (size_t number = 0; number < count; ++number) {
        if (ranges[number].begin != covered) return "tensors overlap, or leave a gap";
        covered = ranges[number].end;
    }
    return covered == file->data_bytes ? NULL : "bytes are left over";
}

/* ---- Reading the metadata ---- */

/* Reads a decimal number, independent of the locale. */
static int real(text value, double *result) {
    double number = 0.0, scale = 1.0;
    int negative = 0, exponent = 0, digits = 0;
    if (value.at < value.end && *value.at == '-') {
        negative = 1;
        ++value.at;
    }
    for (; value.at < value.end && *value.at >= '0' && *value.at <= '9'; ++value.at, ++digits) number = number * 10.0 + (*value.at - '0');
    if (value.at < value.end && *value.at == '.') {
        for (++value.at; value.at < value.end && *value.at >= '0' && *value.at <= '9'; ++value.at, ++digits) {
            scale *= 0.1;
            number += scale * (*value.at - '0');
        }
    }
    if (digits == 0) return 0;
    if (value.at < value.end && (*value.at == 'e' || *value.at == 'E')) {
        int below = 0;
        ++value.at;
        if (value.at < value.end && (*value.at == '-' || *value.at == '+')) below = *value.at++ == '-';
        for (; value.at < value.end && *value.at >= '0' && *value.at <= '9' && exponent < 1000; ++value.at)
            exponent = exponent * 10 + (*value.at - '0');
        for (; exponent > 0 && exponent < 1000; --exponent) number *= below ? 0.1 : 10.0;
    }
    *result = negative ? -number : number;
    return value.at == value.end && number - number == 0.0;
}

static int choice_of(text value, const char *const *names, int count) {
    text string;
    if (!bare_string(value, &string)) return -1;
    for (int number = 0; number < count; ++number) {
        if (is_text(string, names[number])) return number;
    }
    return -1;
}

/* Returns the maps in a JSON list as bits; 0 if they are unknown or not in order. */
static uint32_t read_maps(text list) {
    text element;
    int first = 1, state, before = -1;
    uint32_t maps = 0;
    if (!next_is(&list, '[')) return 0;
    while ((state = next_element(&list, &first, &element)) == 1) {
        int map = choice_of(element, MAP_NAMES, NTC_MOST_MAPS);
        if (map <= before) return 0;
        before = map;
        maps |= 1u << map;
    }
    return state == 0 ? maps : 0;
}

/* Returns the channels of the map `base` if `maps` have `channels` channels in all; -1 if that is impossible. */
static int base_channels_of(uint32_t maps, int channels) {
    int left = channels;
    for (int map = 1; map < NTC_MOST_MAPS; ++map) left -= maps >> map & 1u ? MAP_CHANNELS[map] : 0;
    if (maps & 1u) return left >= 1 && left <= 4 ? left : -1;
    return left == 0 && maps != 0 ? 0 : -1;
}

static int channels_of_map(int map, int base_channels) {
    return map == 0 ? base_channels : MAP_CHANNELS[map];
}

static const char *read_codec(text codec, settings *config) {
    text value, kind;
    uint64_t number;
    int format = 1;
    config->is_grid = 1;
    if (member(codec, "kind", &value)) {
        if (!bare_string(value, &kind)) return "codec.kind is no text";
        config->is_grid = is_text(kind, "grid");
        if (!config->is_grid && !is_text(kind, "block")) return "codec.kind is not known";
    }
    config->maps = 1u;
    if (member(codec, "maps", &value) && (config->maps = read_maps(value)) == 0) return "codec.maps is wrong";
    if (!whole_member(codec, "output_channels", 1, NTC_MOST_CHANNELS, &config->channels)) return "codec.output_channels is wrong";
    config->base_channels = base_channels_of(config->maps, config->channels);
    if (config->base_channels < 0) return "codec.output_channels does not fit the maps";
    if (!member(codec, "levels", &value)) return "codec.levels is missing";
    if (!is_text(value, "null") && (!whole(value, MOST_LEVELS, &number) || (config->levels = (int)number) < 1))
        return "codec.levels is wrong";
    for (int map = 0, channel = 0; map < NTC_MOST_MAPS; ++map) {
        if (!(config->maps >> map & 1u)) continue;
        int plane = config->plane_count - 1;
        if (plane < 0 || config->plane_first[plane] != MAP_PLANES[map]) {
            plane = config->plane_count++;
            config->plane_first[plane] = MAP_PLANES[map];
        }
        for (int part = 0; part < channels_of_map(map, config->base_channels); ++part)
            config->plane_list[plane][config->plane_channels[plane]++] = channel++;
    }
    if (config->is_grid) {
        static const char *const booleans[] = {"adapters", "adapter_output"};
        double slope;
        config->weight_bits = 32;
        if (!whole_member(codec, "latent_channels", 4, 16, &config->latent_channels) || config->latent_channels % 4 ||
            !whole_member(codec, "latent_bits", 4, 8, &config->latent_bits) || config->latent_bits % 4 ||
            !whole_member(codec, "downscale", 1, 64, &config->downscale) ||
            !whole_member(codec, "positional_octaves", 1, 8, &config->octaves) ||
            !whole_member(codec, "hidden_width", 4, 256, &config->hidden) || config->hidden % 4 ||
            !member(codec, "leaky_slope", &value) || !real(value, &slope) || slope < 0.0 || slope >= 1.0)
            return "a field of codec grid is wrong";
        if (member(codec, "weight_bits", &value) &&
            (!whole(value, 32, &number) || (number != 16 && number != 32) || (config->weight_bits = (int)number) == 0))
            return "codec.weight_bits is wrong";
        for (int part = 0; part < 2; ++part) {
            if (!member(codec, booleans[part], &value)) continue;
            if (!is_text(value, "true") && !is_text(value, "false")) return "a field of codec grid is wrong";
            *(part == 0 ? &config->adapters : &config->adapter_output) = is_text(value, "true");
        }
        if (config->adapter_output && !config->adapters) return "codec.adapter_output needs adapters";
        config->leaky_slope = (float)slope;
        config->inputs = config->latent_channels + 4 * config->octaves + (config->levels != 1);
        config->side = config->downscale;
        config->mips = 1;
        return NULL;
    }
    if (member(codec, "format", &value)) {
        if (!whole(value, 99, &number)) return "codec.format is wrong";
        format = (int)number;
    }
    if (format != 2) return format == 1 ? "@codec block has format 1" : "@codec block has a newer format";
    const int most_words = config->maps == 1u ? 16 : 32, most_modes = config->maps == 1u ? 64 : 128;
    if (!whole_member(codec, "mips", 1, 4, &config->mips) || config->mips == 3 ||
        !whole_member(codec, "block_side", 4, 8, &config->side) || (config->side != 4 && config->side != 8) ||
        (config->mips == 4 && config->side != 8) || !whole_member(codec, "modes", 8, most_modes, &config->modes) ||
        (config->modes & (config->modes - 1)) != 0 ||
        !whole_member(codec, "coefficients", 1, config->side * config->side * config->channels, &config->coefficients))
        return "a field of codec block is wrong";
    for (config->mode_bits = 0; 1 << config->mode_bits < config->modes;) ++config->mode_bits;
    if (member(codec, "tables", &value) && !is_text(value, "null")) {
        if (!whole(value, 255, &number) || number == 0) return "codec.tables is wrong";
        config->tables = (int)number;
    }
    int first = 1, state;
    text element;
    if (!member(codec, "block_words", &value) || !next_is(&value, '[')) return "codec.block_words is wrong";
    while ((state = next_element(&value, &first, &element)) == 1) {
        int before = config->classes > 0 ? config->words[config->classes - 1] : 0;
        if (config->classes == MOST_CLASSES || !whole(element, (uint64_t)most_words, &number) || (int)number <= before)
            return "codec.block_words is wrong";
        config->words[config->classes++] = (int)number;
    }
    return state == 0 && config->classes > 0 ? NULL : "codec.block_words is wrong";
}

/* Sets the levels of a texture (docs/reference/codec-block.md and codec-grid.md). */
static void find_levels(const settings *config, int code_mips, texture *target) {
    int count = 0;
    uint64_t cells = 0;
    while (count < MOST_LEVELS && (config->levels == 0 || count < config->levels)) {
        level *made = &target->levels[count];
        const level *before = count > 0 ? &target->levels[count - 1] : NULL;
        int width = target->info.width >> count, height = target->info.height >> count;
        made->texel_width = width > 0 ? width : 1;
        made->texel_height = height > 0 ? height : 1;
        made->width = (made->texel_width + config->side - 1) / config->side;
        made->height = (made->texel_height + config->side - 1) / config->side;
        const int across = made->width > made->height ? made->width : made->height;
        if (before != NULL && before->mip_of_cell + 1 < code_mips && before->texel_width == 2 * made->texel_width &&
            before->texel_height == 2 * made->texel_height) {
            made->width = before->width;
            made->height = before->height;
            made->mip_of_cell = before->mip_of_cell + 1;
            made->first = before->first;
        } else {
            made->mip_of_cell = 0;
            made->first = cells;
            cells += (uint64_t)made->width * (uint64_t)made->height;
        }
        ++count;
        if (across <= (config->is_grid ? 4 : 1)) break;
    }
    target->info.mips = count;
}

static const char *read_texture_metadata(ntc_pack *pack, text document, texture *target) {
    static const char *const wraps[] = {"repeat", "mirror", "clamp"}, *const spaces[] = {"linear", "srgb"};
    const settings *config = &pack->settings;
    ntc_texture_info *info = &target->info;
    text value, element;
    size_t length;
    uint32_t maps = 1u;
    int first = 1;
    if (!member(document, "name", &value) || !bare_string(value, &element)) return "a texture's name is missing";
    if ((info->name = unescaped(&pack->memory, element, &length)) == NULL) return "a texture's name is no text";
    if (!member(document, "pixel_hash", &value) || !bare_string(value, &element)) return "a texture's pixel_hash is missing";
    if ((info->pixel_hash = unescaped(&pack->memory, element, &length)) == NULL) return "a texture's pixel_hash is no text";
    if (!whole_member(document, "width", 1, LARGEST_SIDE, &info->width) ||
        !whole_member(document, "height", 1, LARGEST_SIDE, &info->height) ||
        !whole_member(document, "channels", 1, NTC_MOST_CHANNELS, &info->channels))
        return "a texture's size is wrong";
    if (!member(document, "color_space", &value) || (info->is_srgb = choice_of(value, spaces, 2)) < 0)
        return "a texture's color_space is wrong";
    if (!member(document, "wrap", &value) || !next_is(&value, '[')) return "a texture's wrap is wrong";
    for (int axis = 0; axis < 2; ++axis) {
        int wrap = next_element(&value, &first, &element) == 1 ? choice_of(element, wraps, 3) : -1;
        if (wrap < 0) return "a texture's wrap is wrong";
        info->wrap[axis] = (ntc_wrap)wrap;
    }
    if (member(document, "maps", &value) && (maps = read_maps(value)) == 0) return "a texture's maps are wrong";
    const int base = base_channels_of(maps, info->channels);
    if (base < 0 || (maps & ~config->maps) != 0 || base > config->base_channels) return "a texture's channels do not fit the codec";
    for (int map = 0, place = 0, channel = 0; map < NTC_MOST_MAPS; ++map) {
        const int count = config->maps >> map & 1u ? channels_of_map(map, config->base_channels) : 0;
        if (maps >> map & 1u) {
            const int mine = channels_of_map(map, base);
            info->maps[info->map_count] = (ntc_map)map;
            info->map_channels[info->map_count++] = mine;
            for (int part = 0; part < mine; ++part) target->places[channel++] = place + part;
        }
        for (int part = 0; part < count; ++part) {
            const int is_colour = map == NTC_EMISSIVE || (map == NTC_BASE && info->is_srgb && part < (count % 2 ? 3 : count - 1));
            if (is_colour) target->srgb_channels |= 1u << (place + part);
        }
        place += count;
    }
    int code_mips = config->mips;
    if (member(document, "code_mips", &value) && !is_text(value, "null")) {
        if (!whole_member(document, "code_mips", 1, 2, &code_mips) || code_mips >= config->mips) return "a texture's code_mips is wrong";
    }
    find_levels(config, code_mips, target);
    return NULL;
}

static const char *read_metadata(ntc_pack *pack, text document) {
    text value, grouping, groups, textures, element, name;
    uint64_t number;
    const char *problem;
    int first = 1, state;
    if (!member(document, "format_version", &value) || !whole(value, 1 << 20, &number)) return "format_version is missing";
    if (number != 1) return "@the file has a newer format version";
    if (!member(document, "codec", &value)) return "codec is missing";
    if ((problem = read_codec(value, &pack->settings)) != NULL) return problem;
    if (!whole_member(document, "decoders", 0, MOST_TEXTURES, &pack->decoder_count)) return "decoders is wrong";
    if (!member(document, "textures", &textures)) return "textures is missing";
    value = textures;
    if (!next_is(&value, '[')) return "textures is no list";
    while ((state = next_element(&value, &first, &element)) == 1) {
        if (++pack->texture_count > MOST_TEXTURES) return "too many textures";
    }
    if (state != 0) return "textures is no list";
    pack->textures = (texture *)take(&pack->memory, (size_t)pack->texture_count + 1, sizeof(texture));
    pack->decoders = (decoder *)take(&pack->memory, (size_t)pack->decoder_count + 1, sizeof(decoder));
    if (pack->textures == NULL || pack->decoders == NULL) return "";
    if (!member(document, "grouping", &grouping) || !member(grouping, "groups", &groups) || !next_is(&groups, '['))
        return "grouping.groups is missing";
    first = 1;
    int group_first = 1;
    (void)next_is(&textures, '[');
    for (int index = 0; index < pack->texture_count; ++index) {
        (void)next_element(&textures, &first, &element);
        if ((problem = read_texture_metadata(pack, element, &pack->textures[index])) != NULL) return problem;
        if (next_element(&groups, &group_first, &element) != 1 || !whole(element, MOST_TEXTURES, &number) ||
            (int)number >= pack->decoder_count)
            return "grouping.groups is wrong";
        pack->textures[index].group = (int)number;
    }
    if (next_element(&groups, &group_first, &element) != 0) return "grouping.groups is wrong";
    if (member(grouping, "name", &value) && bare_string(value, &name) && is_text(name, "universal")) return "@universal";
    return NULL;
}

/* ---- Codec block: tables of a decoder ---- */

static const int DEPTH_KEYS[LARGEST_DEPTH + 1] = {0, -10, -33, -60, -89, -113, -143, -174};
static const int LEVEL_STEPS[LARGEST_DEPTH + 1] = {0, -3, 2, 11, 17, 20, 23, 24};
#define LOWEST_KEY (-174)
#define KEYS (2 * 255 - 10 + 174 + 1)

/* Finds the depth of each coefficient of a mode, that is, how the `bits` bits are allocated: they go to the largest keys. Of equal
   keys, that of the lower coefficient comes first, then that of the lower bit. */
static void share_out_bits(const uint8_t *scales, int coefficients, int bits, uint8_t *depths) {
    int counts[KEYS] = {0}, threshold = KEYS, taken = 0;
    for (int k = 0; k < coefficients; ++k) {
        for (int b = 1; b <= LARGEST_DEPTH; ++b) ++counts[2 * scales[k] + DEPTH_KEYS[b] - LOWEST_KEY];
    }
    while (threshold > 0 && taken + counts[threshold - 1] <= bits) taken += counts[--threshold];
    /* All keys from `threshold` on get a bit, and some of those one below. */
    int left = bits - taken;
    for (int k = 0; k < coefficients; ++k) {
        depths[k] = 0;
        for (int b = 1; b <= LARGEST_DEPTH; ++b) {
            const int key = 2 * scales[k] + DEPTH_KEYS[b] - LOWEST_KEY;
            if (key >= threshold) {
                ++depths[k];
            } else if (key == threshold - 1 && left > 0) {
                ++depths[k];
                --left;
            }
        }
    }
}

static int edge_part_bits(const settings *config, int plane, int index_bits) {
    return index_bits == 0 ? 0 : 16 * config->plane_channels[plane] + index_bits * config->side * config->side;
}

static const char *prepare_block_decoder(ntc_pack *pack, decoder *made) {
    const settings *config = &pack->settings;
    const int count = config->coefficients, texels = config->side * config->side;
    const tensor *parts = made->tensors;
    if (!has_shape(&parts[BASIS], I8, 2, (uint64_t)count, (uint64_t)texels) ||
        !has_shape(&parts[CHANNELS], U8, 1, (uint64_t)count, 0) || !has_shape(&parts[BASIS_SCALE], U8, 1, (uint64_t)count, 0) ||
        !has_shape(&parts[SCALES], U8, 2, (uint64_t)config->modes, (uint64_t)count) ||
        !has_shape(&parts[EDGES], U8, 2, (uint64_t)config->modes, (uint64_t)config->plane_count))
        return "a tensor of a decoder is missing, or has another shape";
    int plane_of[NTC_MOST_CHANNELS] = {0}, before = 0;
    for (int plane = 0; plane < config->plane_count; ++plane) {
        for (int part = 0; part < config->plane_channels[plane]; ++part) plane_of[config->plane_list[plane][part]] = plane;
    }
    for (int k = 0; k < count; ++k) {
        if (parts[CHANNELS].data[k] >= config->channels) return "a row of a basis is of a channel that is not there";
        if (plane_of[parts[CHANNELS].data[k]] < before) return "rows of a plane do not lie together";
        before = plane_of[parts[CHANNELS].data[k]];
        if (parts[BASIS_SCALE].data[k] > 192) return "a scale of a basis is too large";
    }
    for (int at = 0; at < config->modes * config->plane_count; ++at) {
        if (parts[EDGES].data[at] > 3) return "an edge part has too many bits";
    }
    for (int mip = 0; mip < config->mips; ++mip) {
        const int side = config->side >> mip, run = 1 << mip;
        float *rows = (float *)take(&pack->memory, (size_t)count * (size_t)(side * side), sizeof(float));
        if (rows == NULL) return "";
        made->rows[mip] = rows;
        for (int k = 0; k < count; ++k) {
            for (int t = 0; t < side * side; ++t) {
                int sum = 0;
                for (int y = 0; y < run; ++y) {
                    for (int x = 0; x < run; ++x) {
                        const int at = (t / side * run + y) * config->side + t % side * run + x;
                        sum += (int8_t)parts[BASIS].data[k * texels + at];
                    }
                }
                rows[k * side * side + t] = (float)sum / (float)(run * run);
            }
        }
    }
    made->layouts = (code_layout *)take(&pack->memory, (size_t)(config->classes * config->modes), sizeof(code_layout));
    uint8_t *depths = (uint8_t *)take(&pack->memory, (size_t)count, 1);
    if (made->layouts == NULL || depths == NULL) return "";
    for (int code_class = 0; code_class < config->classes; ++code_class) {
        for (int mode = 0; mode < config->modes; ++mode) {
            code_layout *layout = &made->layouts[code_class * config->modes + mode];
            const int bits = 32 * config->words[code_class];
            int edges = 0;
            for (int plane = 0; plane < config->plane_count; ++plane)
                edges += edge_part_bits(config, plane, parts[EDGES].data[mode * config->plane_count + plane]);
            if (config->mode_bits + edges > bits) edges = 0;
            layout->has_edges = edges > 0;
            layout->first_branch = config->mode_bits + edges;
            share_out_bits(parts[SCALES].data + mode * count, count, bits - layout->first_branch, depths);
            for (int k = 0; k < count; ++k) layout->count += depths[k] > 0;
            active *list = (active *)take(&pack->memory, (size_t)layout->count + 1, sizeof(active));
            if (list == NULL) return "";
            layout->list = list;
            for (int k = 0; k < count; ++k) {
                if (depths[k] == 0) continue;
                list->coefficient = (uint16_t)k;
                list->depth = depths[k];
                ++list;
            }
        }
    }
    return NULL;
}

/* Returns the number of words in the directory of a level. */
static uint64_t directory_words(const settings *config, uint64_t blocks) {
    return config->classes > 1 ? 2 * ((blocks + DIRECTORY_RUN - 1) / DIRECTORY_RUN) : 0;
}

/* Finds the first word of each level of a texture, and checks the directories. Returns an error, or NULL. */
static const char *prepare_block_texture(ntc_pack *pack, texture *made) {
    const settings *config = &pack->settings;
    tensor *words = &made->tensors[WORDS];
    int numbers = 0;
    uint64_t first = 0;
    for (int plane = 0; plane < config->plane_count; ++plane) numbers += config->plane_channels[plane] * config->plane_channels[plane];
    if (words->data == NULL || words->type != U8 || words->dimensions != 2 || words->shape[1] != 4 ||
        !has_shape(&made->tensors[MEAN], F32, 2, (uint64_t)config->mips, (uint64_t)config->channels) ||
        !(config->maps == 1u ? has_shape(&made->tensors[AXES], F32, 2, (uint64_t)config->channels, (uint64_t)config->channels)
                          : has_shape(&made->tensors[AXES], F32, 1, (uint64_t)numbers, 0)))
        return "a tensor of a texture is missing, or has another shape";
    if (!has_numbers(&made->tensors[MEAN], 16.0f) || !has_numbers(&made->tensors[AXES], 16.0f)) return "a mean or an axis is too large";
    for (int number = 0; number < made->info.mips; ++number) {
        level *stored = &made->levels[number];
        if (stored->mip_of_cell > 0) {
            stored->first = made->levels[number - 1].first;
            continue;
        }
        const uint64_t blocks = (uint64_t)stored->width * (uint64_t)stored->height, directory = directory_words(config, blocks);
        uint64_t place = directory;
        stored->first = first;
        if (words->shape[0] - first < directory + blocks * (uint64_t)config->words[0]) return "latents are too short";
        for (uint64_t block = 0; directory > 0 && block < blocks; ++block) {
            const uint8_t *entry = words->data + 4 * (first + 2 * (block / DIRECTORY_RUN));
            const uint32_t code_class = u32_at(entry + 4) >> (2 * (block % DIRECTORY_RUN)) & 3u;
            if (block % DIRECTORY_RUN == 0 && u32_at(entry) != place) return "a directory does not name the places of codes";
            if ((int)code_class >= config->classes) return "a directory names a size that codes do not have";
            place += (uint64_t)config->words[code_class];
        }
        if (directory == 0) place = blocks * (uint64_t)config->words[0];
        if (words->shape[0] - first < place) return "latents are too short";
        first += place;
    }
    return first == words->shape[0] ? NULL : "latents are too long";
}

/* ---- Codec block: a block's texels ---- */

/* Returns 32 bits of a code of `words` words, from bit `at` on; bits beyond its end are 0. */
static uint32_t code_bits(const uint8_t *code, int words, int at) {
    const int word = at >> 5, shift = at & 31;
    const uint32_t low = word < words ? u32_at(code + 4 * word) : 0u;
    const uint32_t high = word + 1 < words ? u32_at(code + 4 * word + 4) : 0u;
    return shift == 0 ? low : low >> shift | high << (32 - shift);
}

/* Subset of quantiser levels by state and branch bit of the trellis. The first bit of the state is the lowest, as in the code. */
static const uint8_t SUBSETS[16] = {0, 2, 2, 0, 1, 3, 3, 1, 2, 0, 0, 2, 3, 1, 1, 3};

/* Decodes an edge part to [channels][BLOCK_VALUES] of `values`. The part begins at bit `at` of the code.
   `alpha_offset` is added to the map alpha: how far the mean of the mip is above that of mip 0, which keeps a mask's coverage. */
static void edge_values(const settings *config, const uint8_t *code, int words, int plane, int bits, int at, int mip, uint32_t srgb,
                        float alpha_offset, float *values) {
    const int channels = config->plane_channels[plane], side = config->side >> mip, run = 1 << mip;
    const int indices = at + 16 * channels;
    const float whole_run = (float)(((1 << bits) - 1) * run * run);
    float shares[BLOCK_VALUES], variances[BLOCK_VALUES];
    for (int t = 0; t < side * side; ++t) {
        int sum = 0, squares = 0;
        for (int y = 0; y < run; ++y) {
            for (int x = 0; x < run; ++x) {
                const int number = (t / side * run + y) * config->side + t % side * run + x;
                const int index = (int)(code_bits(code, words, indices + bits * number) & ((1u << bits) - 1u));
                sum += index;
                squares += index * index;
            }
        }
        shares[t] = (float)sum / whole_run;
        variances[t] = (float)(squares * run * run - sum * sum) / (whole_run * whole_run);
    }
    for (int part = 0; part < channels; ++part) {
        const int channel = config->plane_list[plane][part];
        const float one = (float)(code_bits(code, words, at + 8 * part) & 255u) / 255.0f;
        const float step = (float)(code_bits(code, words, at + 8 * (channels + part)) & 255u) / 255.0f - one;
        float *value = values + channel * BLOCK_VALUES;
        for (int t = 0; t < side * side; ++t) value[t] = one + step * shares[t];
        /* Colours are averaged as squares, which are close to linear light. */
        if (mip > 0 && (srgb >> channel & 1u))
            for (int t = 0; t < side * side; ++t) value[t] = sqrtf(value[t] * value[t] + step * step * variances[t]);
        if (mip > 0 && config->plane_first[plane] == MAP_PLANES[NTC_ALPHA])
            for (int t = 0; t < side * side; ++t) value[t] += alpha_offset;
    }
}

/* Decodes a block at a mip of its code: [channels][BLOCK_VALUES], not clamped. Sums coefficients times rows of the basis, then
   applies the texture's axes and mean (docs/reference/codec-block.md). */
static void block_values(const ntc_pack *pack, const texture *from, const uint8_t *code, int code_class, int mip, float *values) {
    const settings *config = &pack->settings;
    const decoder *tables = &pack->decoders[from->group];
    const int words = config->words[code_class], side = config->side >> mip, texels = side * side;
    const int mode = (int)(u32_at(code) & (uint32_t)(config->modes - 1));
    const code_layout *layout = &tables->layouts[code_class * config->modes + mode];
    const uint8_t *channels = tables->tensors[CHANNELS].data, *basis_scale = tables->tensors[BASIS_SCALE].data;
    const uint8_t *scales = tables->tensors[SCALES].data + mode * config->coefficients;
    float sums[NTC_MOST_CHANNELS * BLOCK_VALUES];
    memset(sums, 0, sizeof(float) * (size_t)(config->channels * BLOCK_VALUES));
    int branch = layout->first_branch, others = layout->first_branch + layout->count;
    for (int number = 0; number < layout->count; ++number, ++branch) {
        const int k = layout->list[number].coefficient, depth = layout->list[number].depth;
        const uint32_t subset = SUBSETS[code_bits(code, words, branch - 3) & 15u];
        const uint32_t rest = code_bits(code, words, others) & ((1u << (depth - 1)) - 1u);
        others += depth - 1;
        const float s = (float)(2u * (4u * rest + subset) + 1u) / (float)(2 << depth) - 1.0f, size = fabsf(s);
        const float shape = depth < 3 ? s * (1.0f + 1.625f * size * size) : s * (1.0f + size * (-1.5f + 3.0f * size));
        const float value = shape * pack->powers[(int)scales[k] + (int)basis_scale[k] + LEVEL_STEPS[depth] + 3];
        const float *row = tables->rows[mip] + k * texels;
        float *sum = sums + channels[k] * BLOCK_VALUES;
        for (int t = 0; t < texels; ++t) sum[t] += value * row[t];
    }
    float alpha_offset = 0.0f;
    for (int channel = 0; channel < config->channels; ++channel) {
        const float mean = f32_at(from->tensors[MEAN].data + 4 * (mip * config->channels + channel));
        alpha_offset = mean - f32_at(from->tensors[MEAN].data + 4 * channel);
        for (int t = 0; t < texels; ++t) values[channel * BLOCK_VALUES + t] = mean;
    }
    const uint8_t *axes = from->tensors[AXES].data;
    for (int plane = 0, at = config->mode_bits; plane < config->plane_count; ++plane) {
        const int count = config->plane_channels[plane];
        const int bits = layout->has_edges ? tables->tensors[EDGES].data[mode * config->plane_count + plane] : 0;
        if (bits > 0) edge_values(config, code, words, plane, bits, at, mip, from->srgb_channels, alpha_offset, values);
        at += edge_part_bits(config, plane, bits);
        for (int row = 0; row < count; ++row) {
            float *value = values + config->plane_list[plane][row] * BLOCK_VALUES;
            for (int column = 0; column < count; ++column, axes += 4) {
                const float axis = f32_at(axes), *sum = sums + config->plane_list[plane][column] * BLOCK_VALUES;
                if (axis == 0.0f) continue;
                for (int t = 0; t < texels; ++t) value[t] += axis * sum[t];
            }
        }
    }
}

/* Returns the code of a block, and sets its class. */
static const uint8_t *code_of(const settings *config, const texture *from, const level *stored, uint64_t block, int *code_class) {
    const uint8_t *words = from->tensors[WORDS].data + 4 * stored->first;
    *code_class = 0;
    if (config->classes == 1) return words + 4 * block * (uint64_t)config->words[0];
    const uint8_t *entry = words + 8 * (block / DIRECTORY_RUN);
    const uint32_t classes = u32_at(entry + 4);
    uint64_t place = u32_at(entry);
    for (uint64_t before = 0; before < block % DIRECTORY_RUN; ++before) place += (uint64_t)config->words[classes >> 2 * before & 3u];
    *code_class = (int)(classes >> 2 * (block % DIRECTORY_RUN) & 3u);
    return words + 4 * place;
}

static float clamped(float value) {
    return value > 0.0f ? (value < 1.0f ? value : 1.0f) : 0.0f;
}

/* Rounds half to even, as all of ntc-viewer does; `value` is in [0, 255]. */
static uint8_t rounded(float value) {
    const float magic = 12582912.0f;    /* 1.5 x 2^23 */
    volatile float moved = value + magic;
    return (uint8_t)(moved - magic);
}

static void write_value(ntc_type type, void *texels, size_t at, float value) {
    if (type == NTC_U8) ((uint8_t *)texels)[at] = rounded(clamped(value) * 255.0f);
    else ((float *)texels)[at] = clamped(value);
}

typedef struct {
    int x, y, width, height;
} rectangle;

static void decode_block_texture(const ntc_pack *pack, const texture *from, const level *stored, rectangle part, ntc_type type,
                                 uint8_t *texels, size_t row_bytes) {
    const settings *config = &pack->settings;
    const int side = config->side >> stored->mip_of_cell, channels = from->info.channels;
    float values[NTC_MOST_CHANNELS * BLOCK_VALUES];
    for (int row = part.y / side; row * side < part.y + part.height; ++row) {
        for (int column = part.x / side; column * side < part.x + part.width; ++column) {
            int code_class;
            const uint64_t block = (uint64_t)row * (uint64_t)stored->width + (uint64_t)column;
            const uint8_t *code = code_of(config, from, stored, block, &code_class);
            block_values(pack, from, code, code_class, stored->mip_of_cell, values);
            for (int y = 0; y < side; ++y) {
                const int line = row * side + y - part.y;
                if (line < 0 || line >= part.height) continue;
                uint8_t *out = texels + (size_t)line * row_bytes;
                for (int x = 0; x < side; ++x) {
                    const int place = column * side + x - part.x;
                    if (place < 0 || place >= part.width) continue;
                    for (int channel = 0; channel < channels; ++channel)
                        write_value(type, out, (size_t)(place * channels + channel),
                                    values[from->places[channel] * BLOCK_VALUES + y * side + x]);
                }
            }
        }
    }
}

/* ---- Codec grid ---- */

static float number_of(const tensor *part, size_t at) {
    return part->type == F32 ? f32_at(part->data + 4 * at) : f16_at(part->data + 2 * at);
}

static void layer_shape(const settings *config, int layer, int *outputs, int *inputs) {
    *outputs = layer == 2 ? config->channels : config->hidden;
    *inputs = layer == 0 ? config->inputs : config->hidden;
}

static const char *prepare_grid_decoder(ntc_pack *pack, decoder *made) {
    const settings *config = &pack->settings;
    const tensor_type type = config->weight_bits == 16 ? F16 : F32;
    for (int layer = 0; layer < 3; ++layer) {
        const tensor *weight = &made->tensors[WEIGHT_0 + 2 * layer], *bias = &made->tensors[BIAS_0 + 2 * layer];
        int outputs, inputs;
        layer_shape(config, layer, &outputs, &inputs);
        if (!has_shape(weight, type, 2, (uint64_t)outputs, (uint64_t)inputs) || !has_shape(bias, type, 1, (uint64_t)outputs, 0))
            return "a tensor of a decoder is missing, or has another shape";
        made->weights[layer] = (float *)take(&pack->memory, (size_t)(outputs * inputs), sizeof(float));
        made->biases[layer] = (float *)take(&pack->memory, (size_t)outputs, sizeof(float));
        if (made->weights[layer] == NULL || made->biases[layer] == NULL) return "";
        for (int output = 0; output < outputs; ++output) {
            made->biases[layer][output] = number_of(bias, (size_t)output);
            for (int input = 0; input < inputs; ++input)
                made->weights[layer][input * outputs + output] = number_of(weight, (size_t)(output * inputs + input));
        }
    }
    return NULL;
}

static const char *prepare_grid_texture(ntc_pack *pack, texture *made) {
    const settings *config = &pack->settings;
    const tensor *parts = made->tensors;
    uint64_t cells = 0;
    for (int number = 0; number < made->info.mips; ++number)
        cells += (uint64_t)made->levels[number].width * (uint64_t)made->levels[number].height;
    int fits = has_shape(&parts[WORDS], U8, 2, cells, (uint64_t)(config->latent_channels * config->latent_bits / 8)) &&
               has_shape(&parts[SCALE], F32, 1, (uint64_t)config->latent_channels, 0) &&
               has_shape(&parts[OFFSET], F32, 1, (uint64_t)config->latent_channels, 0);
    if (config->adapters)
        fits = fits && has_shape(&parts[ADAPTER_SCALES], F16, 2, 2, (uint64_t)config->hidden) &&
               has_shape(&parts[ADAPTER_BIASES], F16, 2, 2, (uint64_t)config->hidden);
    if (config->adapter_output)
        fits = fits && has_shape(&parts[ADAPTER_WEIGHT], F16, 2, (uint64_t)config->channels, (uint64_t)config->hidden) &&
               has_shape(&parts[ADAPTER_BIAS], F16, 1, (uint64_t)config->channels, 0);
    return fits ? NULL : "a tensor of a texture is missing, or has another shape";
}

/* Finds the two cells of a bilinear read at cell coordinate `at`, and the weight of the second. */
static float cell_pair(double at, int cells, ntc_wrap wrap, int *first, int *second) {
    const double low = floor(at);
    *first = (int)low;
    *second = *first + 1;
    if (*first < 0) *first = wrap == NTC_REPEAT ? cells - 1 : 0;
    if (*second >= cells) *second = wrap == NTC_REPEAT ? 0 : cells - 1;
    return (float)(at - low);
}

static float triangle_wave(double turns) {
    return (float)(4.0 * fabs(turns - floor(turns) - 0.5) - 1.0);
}

static float latent(const settings *config, const texture *from, uint64_t cell, int channel) {
    const uint8_t *cells = from->tensors[WORDS].data;
    if (config->latent_bits == 8) return (float)cells[cell * (uint64_t)config->latent_channels + (uint64_t)channel];
    const uint8_t both = cells[cell * (uint64_t)(config->latent_channels / 2) + (uint64_t)(channel / 2)];
    return (float)(channel % 2 ? both >> 4 : both & 15);
}

static void decode_grid_texel(const ntc_pack *pack, const texture *from, int mip, int x, int y, float *values) {
    const settings *config = &pack->settings;
    const level *stored = &from->levels[mip];
    const decoder *network = &pack->decoders[from->group];
    const double u = (x + 0.5) / stored->texel_width, v = (y + 0.5) / stored->texel_height;
    float first_layer[16 + 32 + 1], hidden[2][256];
    int left, right, top, bottom, count = 0;
    const float across = cell_pair(u * stored->width - 0.5, stored->width, from->info.wrap[0], &left, &right);
    const float down = cell_pair(v * stored->height - 0.5, stored->height, from->info.wrap[1], &top, &bottom);
    const uint64_t upper = stored->first + (uint64_t)top * (uint64_t)stored->width;
    const uint64_t lower = stored->first + (uint64_t)bottom * (uint64_t)stored->width;
    for (; count < config->latent_channels; ++count) {
        const float a = latent(config, from, upper + (uint64_t)left, count), b = latent(config, from, upper + (uint64_t)right, count);
        const float c = latent(config, from, lower + (uint64_t)left, count), d = latent(config, from, lower + (uint64_t)right, count);
        const float one = a + (b - a) * across, other = c + (d - c) * across;
        first_layer[count] = number_of(&from->tensors[OFFSET], (size_t)count) +
                             number_of(&from->tensors[SCALE], (size_t)count) * (one + (other - one) * down);
    }
    for (int axis = 0; axis < 2; ++axis) {
        double turns = axis == 0 ? x + 0.5 : y + 0.5;
        for (int octave = 0; octave < config->octaves; ++octave) {
            turns *= 0.5;
            first_layer[count++] = triangle_wave(turns);
            first_layer[count++] = triangle_wave(turns + 0.25);
        }
    }
    if (config->levels != 1) first_layer[count++] = (float)mip * 0.125f;
    const float *inputs = first_layer;
    for (int layer = 0; layer < 3; ++layer) {
        int outputs, width;
        float *sums = layer < 2 ? hidden[layer] : values;
        layer_shape(config, layer, &outputs, &width);
        memset(sums, 0, sizeof(float) * (size_t)outputs);
        if (layer == 2 && config->adapter_output) {
            for (int output = 0; output < outputs; ++output) {
                for (int input = 0; input < width; ++input)
                    sums[output] += inputs[input] * number_of(&from->tensors[ADAPTER_WEIGHT], (size_t)(output * width + input));
                sums[output] += number_of(&from->tensors[ADAPTER_BIAS], (size_t)output);
            }
            continue;
        }
        const float *weights = network->weights[layer];
        for (int input = 0; input < width; ++input, weights += outputs) {
            const float value = inputs[input];
            for (int output = 0; output < outputs; ++output) sums[output] += value * weights[output];
        }
        for (int output = 0; output < outputs; ++output) {
            if (layer < 2 && config->adapters) {
                const size_t at = (size_t)(layer * config->hidden + output);
                sums[output] = sums[output] * number_of(&from->tensors[ADAPTER_SCALES], at) + number_of(&from->tensors[ADAPTER_BIASES], at);
            } else {
                sums[output] += network->biases[layer][output];
            }
            if (layer < 2 && sums[output] < 0.0f) sums[output] *= config->leaky_slope;
        }
        inputs = sums;
    }
}

static void decode_grid_texture(const ntc_pack *pack, const texture *from, int mip, rectangle part, ntc_type type, uint8_t *texels,
                                size_t row_bytes) {
    const int channels = from->info.channels;
    float values[NTC_MOST_CHANNELS];
    for (int y = 0; y < part.height; ++y) {
        for (int x = 0; x < part.width; ++x) {
            decode_grid_texel(pack, from, mip, part.x + x, part.y + y, values);
            for (int channel = 0; channel < channels; ++channel)
                write_value(type, texels + (size_t)y * row_bytes, (size_t)(x * channels + channel), values[from->places[channel]]);
        }
    }
}

/* ---- Opening ---- */

static const char *prepare(ntc_pack *pack) {
    static const double ROOTS[16] = {1.0, 1.0442737824274138, 1.0905077326652577, 1.1387886347566916, 1.189207115002721,
                                     1.2418578120734840, 1.2968395546510096, 1.3542555469368927, 1.4142135623730951,
                                     1.4768261459394993, 1.5422108254079408, 1.6104903319492543, 1.6817928305074290,
                                     1.7562521603732995, 1.8340080864093424, 1.9152065613971474};
    for (int at = 0; at < 512; ++at) {
        /* Entry 0 is 2^(-(384 + 3) / 16), the smallest product of a coefficient's factors. */
        const int steps = at - 387 + 16 * 32;
        pack->powers[at] = (float)ldexp(ROOTS[steps & 15], (steps >> 4) - 32);
    }
    for (int index = 0; index < pack->decoder_count; ++index) {
        decoder *made = &pack->decoders[index];
        const char *problem = pack->settings.is_grid ? prepare_grid_decoder(pack, made) : prepare_block_decoder(pack, made);
        if (problem != NULL) return problem;
    }
    for (int index = 0; index < pack->texture_count; ++index) {
        texture *made = &pack->textures[index];
        const char *problem = pack->settings.is_grid ? prepare_grid_texture(pack, made) : prepare_block_texture(pack, made);
        if (problem != NULL) return problem;
    }
    return NULL;
}

/* Reads the tables that ship with the program as the tensors of decoder 0. */
static const char *read_shipped(ntc_pack *pack) {
    static const char *const names[] = {"basis", "channels", "basis_scale", "scales", "edges"};
    container file;
    text value;
    if (pack->memory.options.tables == NULL) return "@grouping universal needs its tables: give options.tables";
    if (!open_container(pack->memory.options.tables, pack->memory.options.tables_bytes, &file)) return "options.tables is no safetensors file";
    for (int part = BASIS; part <= EDGES; ++part) {
        if (!member(file.header, names[part - BASIS], &value) ||
            !read_tensor(value, file.data_bytes, file.data, &pack->decoders[0].tensors[part]))
            return "options.tables lacks a tensor";
    }
    return NULL;
}

#define BANDS 5

static void set_bytes(tensor *made, const uint8_t *data, tensor_type type, int dimensions, uint64_t first, uint64_t second) {
    made->data = data;
    made->type = type;
    made->dimensions = dimensions;
    made->shape[0] = first;
    made->shape[1] = second;
}

/* Makes the tables of each decoder from shipped tables for whole materials: takes the rows of the codec's channels, and scales them
   by the decoder's gains. */
static const char *read_scaled(ntc_pack *pack) {
    static const char *const names[] = {"basis", "channels", "basis_scale", "scales", "edges", "bands"};
    const settings *config = &pack->settings;
    const int texels = config->side * config->side;
    tensor parts[6];
    container file;
    text value;
    memset(parts, 0, sizeof parts);
    if (pack->memory.options.tables == NULL) return "@the pack needs tables for whole materials: give options.tables";
    if (!open_container(pack->memory.options.tables, pack->memory.options.tables_bytes, &file)) return "options.tables is no safetensors file";
    for (int part = 0; part < 6; ++part) {
        if (!member(file.header, names[part], &value) || !read_tensor(value, file.data_bytes, file.data, &parts[part]))
            return "options.tables lacks a tensor";
    }
    const uint64_t rows = parts[0].shape[0];
    if (rows > (uint64_t)(TABLE_CHANNELS * BLOCK_VALUES) || !has_shape(&parts[0], I8, 2, rows, (uint64_t)texels) ||
        !has_shape(&parts[1], U8, 1, rows, 0) || !has_shape(&parts[2], U8, 1, rows, 0) ||
        !has_shape(&parts[3], U8, 2, (uint64_t)config->modes, rows) || !has_shape(&parts[4], U8, 2, (uint64_t)config->modes, TABLE_PLANES) ||
        !has_shape(&parts[5], U8, 1, rows, 0))
        return "options.tables has other shapes";
    /* The tables have all maps but alpha. The fourth channel of their base colour is used for the map alpha. */
    int channel_of[NTC_MOST_CHANNELS], known = 0, channel = 0;
    if ((config->maps >> NTC_ALPHA & 1u) && config->base_channels == 4) return "options.tables has other channels than the pack";
    for (int map = 0; map < NTC_ALPHA; ++map) {
        const int there = config->maps >> map & 1u ? channels_of_map(map, config->base_channels) : 0;
        for (int part = 0; part < channels_of_map(map, 4); ++part) channel_of[known++] = part < there ? channel++ : -1;
    }
    if (config->maps >> NTC_ALPHA & 1u) channel_of[3] = channel++;
    const size_t count = (size_t)config->coefficients, modes = (size_t)config->modes;
    uint8_t *basis = (uint8_t *)take(&pack->memory, count, (size_t)texels), *channels = (uint8_t *)take(&pack->memory, count, 1);
    uint8_t *basis_scale = (uint8_t *)take(&pack->memory, count, 1), *bands = (uint8_t *)take(&pack->memory, count, 1);
    uint8_t *edges = (uint8_t *)take(&pack->memory, modes, (size_t)config->plane_count);
    size_t *places = (size_t *)take(&pack->memory, count, sizeof(size_t)), used = 0;
    if (basis == NULL || channels == NULL || basis_scale == NULL || bands == NULL || edges == NULL || places == NULL) return "";
    /* The rows of a plane are contiguous; those of alpha come last. */
    const int alpha = config->maps >> NTC_ALPHA & 1u ? config->channels - 1 : -1;
    for (size_t number = 0; number < (size_t)rows * 2; ++number) {
        const size_t row = number % (size_t)rows;
        const int full = parts[1].data[row];
        if (full >= TABLE_CHANNELS || parts[5].data[row] >= BANDS) return "options.tables holds a number that is out of range";
        if (channel_of[full] < 0 || (channel_of[full] == alpha) != (number >= (size_t)rows)) continue;
        if (used == count) return "options.tables has other rows than the pack";
        memcpy(basis + used * (size_t)texels, parts[0].data + row * (size_t)texels, (size_t)texels);
        channels[used] = (uint8_t)channel_of[full];
        basis_scale[used] = parts[2].data[row];
        bands[used] = (uint8_t)(channel_of[full] * BANDS + parts[5].data[row]);
        places[used++] = row;
    }
    if (used != count) return "options.tables has other rows than the pack";
    for (size_t mode = 0; mode < modes; ++mode) {
        for (int plane = 0; plane < config->plane_count; ++plane) {
            const size_t full = (size_t)config->plane_first[plane];
            const uint8_t bits = full < TABLE_PLANES ? parts[4].data[mode * TABLE_PLANES + full] : (uint8_t)(mode & 1u);
            edges[mode * (size_t)config->plane_count + (size_t)plane] = bits;
        }
    }
    for (int number = 0; number < pack->decoder_count; ++number) {
        tensor *made = pack->decoders[number].tensors;
        const tensor *gains = &made[GAINS];
        uint8_t *scales = (uint8_t *)take(&pack->memory, modes, count);
        if (scales == NULL) return "";
        /* There is a gain for each coefficient, or one for each band. */
        const int fine = has_shape(gains, I8, 1, count, 0);
        if (!fine && !has_shape(gains, I8, 1, (uint64_t)(config->channels * BANDS), 0))
            return "a tensor of a decoder is missing, or has another shape";
        for (size_t mode = 0; mode < modes; ++mode) {
            for (size_t k = 0; k < count; ++k) {
                const int scale = parts[3].data[mode * (size_t)rows + places[k]] + (int8_t)gains->data[fine ? k : bands[k]];
                scales[mode * count + k] = (uint8_t)(scale < 0 ? 0 : scale > 255 ? 255 : scale);
            }
        }
        set_bytes(&made[BASIS], basis, I8, 2, count, (uint64_t)texels);
        set_bytes(&made[CHANNELS], channels, U8, 1, count, 0);
        set_bytes(&made[BASIS_SCALE], basis_scale, U8, 1, count, 0);
        set_bytes(&made[SCALES], scales, U8, 2, modes, count);
        set_bytes(&made[EDGES], edges, U8, 2, modes, (uint64_t)config->plane_count);
    }
    return NULL;
}

static const char *open_pack(ntc_pack *pack, const void *data, size_t bytes) {
    container file;
    text metadata, value;
    size_t length;
    if (!open_container(data, bytes, &file)) return "it is no safetensors file";
    if (!member(file.header, "__metadata__", &value) || !member(value, "ntc", &metadata) || !bare_string(metadata, &value))
        return "it has no metadata of ntc-viewer";
    char *document = unescaped(&pack->memory, value, &length);
    if (document == NULL) return "the metadata are no text";
    text json = {document, document + length}, whole_value = json, ignored;
    if (!skip_value(&whole_value, DEEPEST_JSON, &ignored) || (skip_space(&whole_value), whole_value.at != whole_value.end))
        return "the metadata are not JSON";
    const char *problem = read_metadata(pack, json);
    const int universal = problem != NULL && strcmp(problem, "@universal") == 0;
    if (problem != NULL && !universal) return problem;
    const int scaled = !pack->settings.is_grid && pack->settings.tables > 0, ships = universal && !scaled;
    if (ships) {
        /* The file stores no decoder. */
        if (pack->settings.is_grid || pack->decoder_count != 1) return "grouping universal names no tables";
        pack->decoder_count = 0;
    }
    problem = read_tensors(pack, &file);
    if (problem == NULL && ships) {
        pack->decoder_count = 1;
        problem = read_shipped(pack);
    }
    for (int number = 0; problem == NULL && number < pack->decoder_count; ++number) {
        for (int part = 0; part < DECODER_TENSORS; ++part) {
            if ((part == GAINS) != scaled && pack->decoders[number].tensors[part].data != NULL)
                return "a tensor does not belong there";
        }
    }
    if (problem == NULL && scaled) problem = read_scaled(pack);
    return problem != NULL ? problem : prepare(pack);
}

ntc_status ntc_open(const void *data, size_t bytes, const ntc_options *options, ntc_pack **pack, ntc_error *error) {
    memory pool;
    memset(&pool, 0, sizeof pool);
    if (options != NULL) pool.options = *options;
    if (pool.options.allocate == NULL) pool.options.allocate = default_allocate;
    if (pool.options.release == NULL) pool.options.release = default_release;
    if (error != NULL) error->text[0] = 0;
    *pack = NULL;
    ntc_pack *made = (ntc_pack *)take(&pool, 1, sizeof(ntc_pack));
    if (made == NULL) return fail(error, NTC_NO_MEMORY, "there is no memory for the pack");
    made->memory = pool;
    const char *problem = open_pack(made, data, bytes);
    if (problem == NULL) {
        *pack = made;
        return NTC_OK;
    }
    pool = made->memory;
    release_all(&pool);
    if (*problem == 0) return fail(error, NTC_NO_MEMORY, "there is no memory for the pack");
    if (*problem == '@') return fail(error, NTC_UNSUPPORTED, problem + 1);
    return fail(error, NTC_BAD_FILE, problem);
}

void ntc_close(ntc_pack *pack) {
    if (pack == NULL) return;
    memory pool = pack->memory;
    release_all(&pool);
}

int ntc_texture_count(const ntc_pack *pack) {
    return pack->texture_count;
}

ntc_status ntc_texture(const ntc_pack *pack, int texture, ntc_texture_info *info) {
    if (texture < 0 || texture >= pack->texture_count) return NTC_BAD_ARGUMENT;
    *info = pack->textures[texture].info;
    return NTC_OK;
}

int ntc_find(const ntc_pack *pack, const char *pixel_hash) {
    for (int index = 0; index < pack->texture_count; ++index) {
        if (strcmp(pack->textures[index].info.pixel_hash, pixel_hash) == 0) return index;
    }
    return -1;
}

ntc_status ntc_decode(const ntc_pack *pack, int texture_number, int mip, int x, int y, int width, int height, ntc_type type, void *texels,
                      size_t row_bytes) {
    if (texture_number < 0 || texture_number >= pack->texture_count) return NTC_BAD_ARGUMENT;
    const texture *from = &pack->textures[texture_number];
    if (mip < 0 || mip >= from->info.mips || (type != NTC_U8 && type != NTC_F32)) return NTC_BAD_ARGUMENT;
    const level *stored = &from->levels[mip];
    if (x < 0 || y < 0 || width < 0 || height < 0 || width > stored->texel_width - x || height > stored->texel_height - y)
        return NTC_BAD_ARGUMENT;
    const rectangle part = {x, y, width, height};
    if (width == 0 || height == 0) return NTC_OK;
    if (pack->settings.is_grid) decode_grid_texture(pack, from, mip, part, type, (uint8_t *)texels, row_bytes);
    else decode_block_texture(pack, from, stored, part, type, (uint8_t *)texels, row_bytes);
    return NTC_OK;
}

/* ---- Compression to BC4, BC5 and BC7 (formats of EXT_texture_compression_rgtc and ARB_texture_compression_bptc) ----

   All formats approximate the texels of a block by points on a line: two ends, and an index for each texel. BC4 has a line of one
   channel; all ends near the smallest and largest value are tried. BC5 is two BC4 blocks. For BC7:
   1. The line starts along the principal axis of the texels (power iteration on their covariance).
   2. Each texel takes the nearest point of the palette. Least squares then gives better ends for these indices, twice.
   3. Mode 6, one line through RGBA, comes first. If its error is small, it is used. Else mode 5 (one line for three channels and one
      for the fourth, with 4 rotations) competes if alpha varies, and modes 1 or 7 (two subsets with a line each) in the partitions
      that leave the smallest distance from two principal axes.
   The GLSL twin is shaders/passes/compress; docs/explanation/decode-paths.md gives its results. */

typedef struct {
    uint8_t *bytes;
    int at;
} bit_writer;

static void put_bits(bit_writer *out, uint32_t value, int count) {
    for (int bit = 0; bit < count; ++bit, ++out->at) out->bytes[out->at >> 3] |= (uint8_t)((value >> bit & 1u) << (out->at & 7));
}

/* Sets the palette of a BC4 block: 8 values if `first` is the larger end, else 6 values, 0 and 255. */
static void bc4_palette(int first, int second, float *palette) {
    palette[0] = (float)first;
    palette[1] = (float)second;
    const int steps = first > second ? 7 : 5;
    for (int index = 1; index < steps; ++index) palette[index + 1] = (float)((steps - index) * first + index * second) / (float)steps;
    if (steps == 5) {
        palette[6] = 0.0f;
        palette[7] = 255.0f;
    }
}

static float bc4_fit(const float *values, int first, int second, uint8_t *indices) {
    float palette[8], error = 0.0f;
    bc4_palette(first, second, palette);
    for (int texel = 0; texel < 16; ++texel) {
        float best = 1e30f;
        for (int index = 0; index < 8; ++index) {
            const float distance = (values[texel] - palette[index]) * (values[texel] - palette[index]);
            if (distance < best) {
                best = distance;
                indices[texel] = (uint8_t)index;
            }
        }
        error += best;
    }
    return error;
}

static void compress_bc4(const float *values, int is_quick, uint8_t *block) {
    int low = 255, high = 0, inner_low = 255, inner_high = 0, best_first = 0, best_second = 0;
    uint8_t indices[16], best_indices[16] = {0};
    float best = 1e30f;
    for (int texel = 0; texel < 16; ++texel) {
        const int value = (int)(values[texel] + 0.5f);
        if (value < low) low = value;
        if (value > high) high = value;
        if (value > 0 && value < inner_low) inner_low = value;
        if (value < 255 && value > inner_high) inner_high = value;
    }
    /* Ends slightly inside or outside the range of values may fit better, because the six values between them are rounded. */
    const int reach = is_quick ? 0 : high - low > 64 ? 3 : 2;
    for (int up = -reach; up <= reach; ++up) {
        for (int down = -reach; down <= reach; ++down) {
            const int first = high + up, second = low + down;
            if (first > 255 || second < 0 || first <= second) continue;
            const float error = bc4_fit(values, first, second, indices);
            if (error < best) {
                best = error;
                best_first = first;
                best_second = second;
                memcpy(best_indices, indices, 16);
            }
        }
    }
    if (best > 0.0f && (low == 0 || high == 255) && inner_low <= inner_high) {
        const float error = bc4_fit(values, inner_low, inner_high, indices);
        if (error < best) {
            best = error;
            best_first = inner_low;
            best_second = inner_high;
            memcpy(best_indices, indices, 16);
        }
    }
    if (best == 1e30f) {
        best_first = high;
        best_second = low;
        (void)bc4_fit(values, high, low, best_indices);
    }
    bit_writer out = {block, 0};
    memset(block, 0, 8);
    put_bits(&out, (uint32_t)best_first, 8);
    put_bits(&out, (uint32_t)best_second, 8);
    for (int texel = 0; texel < 16; ++texel) put_bits(&out, best_indices[texel], 3);
}

static const int WEIGHTS_2[4] = {0, 21, 43, 64};
static const int WEIGHTS_3[8] = {0, 9, 18, 27, 37, 46, 55, 64};
static const int WEIGHTS_4[16] = {0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64};

/* How a mode of BC7 stores a line: the precision of its ends and of the indices. */
typedef struct {
    int first, count;      /* channels */
    int bits;              /* bits of an end's channel, without its p bit */
    int p_bits;            /* 0: none, 1: one for both ends, 2: one for each */
    int index_bits;
    const int *weights;    /* weights of the second end, in 1/64 */
} line_kind;

static const line_kind MODE_1 = {0, 3, 6, 1, 3, WEIGHTS_3};
static const line_kind MODE_5_COLOURS = {0, 3, 7, 0, 2, WEIGHTS_2};
static const line_kind MODE_5_ALPHA = {3, 1, 8, 0, 2, WEIGHTS_2};
static const line_kind MODE_6 = {0, 4, 7, 2, 4, WEIGHTS_4};
static const line_kind MODE_7 = {0, 4, 5, 2, 2, WEIGHTS_2};

/* Second subsets of the 16 partitions that are tried, as bits of texels, texel 0 lowest. The anchors of the subsets are texels 0
   and 15. */
static const uint16_t PARTITIONS[16] = {0xCCCC, 0x8888, 0xEEEE, 0xECC8, 0xC880, 0xFEEC, 0xFEC8, 0xEC80,
                                        0xC800, 0xFFEC, 0xFE80, 0xE800, 0xFFE8, 0xFF00, 0xFFF0, 0xF000};

typedef struct {
    int ends[2][4];         /* stored integers, the p bit lowest */
    uint8_t indices[16];
    float error;            /* squared error in steps of 1/255 */
} line_fit;

typedef const float colours[16][4];

static int stored_end(const line_kind *kind, float value, int p_bit) {
    const int total = kind->bits + (kind->p_bits > 0), most = (1 << kind->bits) - 1;
    const float scaled = value * (float)((1 << total) - 1) / 255.0f;
    int stored = (int)floorf(kind->p_bits > 0 ? (scaled - (float)p_bit) * 0.5f + 0.5f : scaled + 0.5f);
    stored = stored < 0 ? 0 : stored > most ? most : stored;
    return kind->p_bits > 0 ? stored * 2 + p_bit : stored;
}

static int expanded_end(const line_kind *kind, int stored) {
    const int total = kind->bits + (kind->p_bits > 0);
    return total == 8 ? stored : (stored << (8 - total)) | (stored >> (2 * total - 8));
}

/* Sets the indices of `made` to the nearest palette entries of its ends, and its error. */
static void find_indices(const line_kind *kind, colours texels, uint32_t mask, line_fit *made) {
    const int count = 1 << kind->index_bits, last = kind->first + kind->count;
    float palette[16][4], way[4], length = 0.0f;
    int ends[2][4];
    for (int part = kind->first; part < last; ++part) {
        ends[0][part] = expanded_end(kind, made->ends[0][part]);
        ends[1][part] = expanded_end(kind, made->ends[1][part]);
        way[part] = (float)(ends[1][part] - ends[0][part]);
        length += way[part] * way[part];
        for (int index = 0; index < count; ++index)
            palette[index][part] = (float)(((64 - kind->weights[index]) * ends[0][part] + kind->weights[index] * ends[1][part] + 32) >> 6);
    }
    made->error = 0.0f;
    for (int texel = 0; texel < 16; ++texel) {
        float along = 0.0f, best = 1e30f;
        if (!(mask >> texel & 1u)) continue;
        for (int part = kind->first; part < last; ++part) along += (texels[texel][part] - (float)ends[0][part]) * way[part];
        int near = length > 0.0f ? (int)(along / length * (float)(count - 1) + 0.5f) : 0;
        near = near < 0 ? 0 : near >= count ? count - 1 : near;
        for (int index = near > 0 ? near - 1 : 0; index <= near + 1 && index < count; ++index) {
            float distance = 0.0f;
            for (int part = kind->first; part < last; ++part)
                distance += (texels[texel][part] - palette[index][part]) * (texels[texel][part] - palette[index][part]);
            if (distance < best) {
                best = distance;
                made->indices[texel] = (uint8_t)index;
            }
        }
        made->error += best;
    }
}

/* Quantises `ends` with each combination of p bits. Replaces `best` if one has a smaller error. */
static void try_ends(const line_kind *kind, colours texels, uint32_t mask, float ends[2][4], line_fit *best) {
    for (int p_bits = 0; p_bits < 4; ++p_bits) {
        line_fit made = *best;
        if ((kind->p_bits == 0 && p_bits > 0) || (kind->p_bits == 1 && (p_bits == 1 || p_bits == 2))) continue;
        for (int part = kind->first; part < kind->first + kind->count; ++part) {
            made.ends[0][part] = stored_end(kind, ends[0][part], p_bits & 1);
            made.ends[1][part] = stored_end(kind, ends[1][part], p_bits >> 1);
        }
        find_indices(kind, texels, mask, &made);
        if (made.error < best->error) *best = made;
    }
}

/* Computes the ends with the least squared error for the indices of `from`. Returns 0 if all texels have the same index. */
static int refit(const line_kind *kind, colours texels, uint32_t mask, const line_fit *from, float ends[2][4]) {
    float a = 0.0f, b = 0.0f, c = 0.0f, x[4] = {0}, y[4] = {0};
    for (int texel = 0; texel < 16; ++texel) {
        if (!(mask >> texel & 1u)) continue;
        const float w = (float)kind->weights[from->indices[texel]] / 64.0f, v = 1.0f - w;
        a += v * v;
        b += v * w;
        c += w * w;
        for (int part = kind->first; part < kind->first + kind->count; ++part) {
            x[part] += v * texels[texel][part];
            y[part] += w * texels[texel][part];
        }
    }
    const float determinant = a * c - b * b;
    if (fabsf(determinant) < 1e-4f) return 0;
    for (int part = kind->first; part < kind->first + kind->count; ++part) {
        ends[0][part] = (c * x[part] - b * y[part]) / determinant;
        ends[1][part] = (a * y[part] - b * x[part]) / determinant;
    }
    return 1;
}

/* Computes the mean and the principal axis of texels, by power iteration. Returns the sum of squared distances from that axis. */
static float principal_axis(const line_kind *kind, colours texels, uint32_t mask, int rounds, float mean[4], float axis[4]) {
    const int first = kind->first, last = kind->first + kind->count;
    float spread[4][4] = {{0}}, texel_count = 0.0f, total = 0.0f, along = 0.0f;
    int widest = first;
    memset(mean, 0, 4 * sizeof(float));
    for (int texel = 0; texel < 16; ++texel) {
        if (!(mask >> texel & 1u)) continue;
        texel_count += 1.0f;
        for (int part = first; part < last; ++part) mean[part] += texels[texel][part];
    }
    for (int part = first; part < last; ++part) mean[part] /= texel_count;
    for (int texel = 0; texel < 16; ++texel) {
        if (!(mask >> texel & 1u)) continue;
        for (int row = first; row < last; ++row) {
            for (int column = first; column < last; ++column)
                spread[row][column] += (texels[texel][row] - mean[row]) * (texels[texel][column] - mean[column]);
        }
    }
    for (int part = first; part < last; ++part) {
        total += spread[part][part];
        if (spread[part][part] > spread[widest][widest]) widest = part;
    }
    memcpy(axis, spread[widest], 4 * sizeof(float));
    for (int round = 0; round < rounds; ++round) {
        float next[4] = {0}, length = 0.0f, before = 0.0f;
        for (int row = first; row < last; ++row) {
            for (int column = first; column < last; ++column) next[row] += spread[row][column] * axis[column];
            length += next[row] * next[row];
            before += axis[row] * axis[row];
        }
        along = before > 0.0f ? sqrtf(length / before) : 0.0f;
        length = sqrtf(length);
        for (int part = first; part < last; ++part) axis[part] = length > 0.0f ? next[part] / length : 0.0f;
    }
    return total - along;
}

/* Computes the ends of a line along the principal axis of the texels in `mask`. */
static void find_ends(const line_kind *kind, colours texels, uint32_t mask, int rounds, float ends[2][4]) {
    float mean[4], axis[4], low = 1e30f, high = -1e30f;
    principal_axis(kind, texels, mask, rounds, mean, axis);
    for (int texel = 0; texel < 16; ++texel) {
        float along = 0.0f;
        if (!(mask >> texel & 1u)) continue;
        for (int part = kind->first; part < kind->first + kind->count; ++part) along += (texels[texel][part] - mean[part]) * axis[part];
        if (along < low) low = along;
        if (along > high) high = along;
    }
    for (int part = kind->first; part < kind->first + kind->count; ++part) {
        ends[0][part] = mean[part] + low * axis[part];
        ends[1][part] = mean[part] + high * axis[part];
    }
}

/* Returns the best line of `kind` for the texels in `mask`: principal axis, then two refits. */
static line_fit fit_line(const line_kind *kind, colours texels, uint32_t mask) {
    float ends[2][4] = {{0}};
    line_fit best;
    memset(&best, 0, sizeof best);
    best.error = 1e30f;
    find_ends(kind, texels, mask, 8, ends);
    try_ends(kind, texels, mask, ends, &best);
    for (int round = 0; round < 2 && best.error > 0.0f && refit(kind, texels, mask, &best, ends); ++round)
        try_ends(kind, texels, mask, ends, &best);
    return best;
}

/* Quantises each of `ends` with its nearer p bit. Replaces `best` if the error is smaller. */
static void try_nearest_ends(const line_kind *kind, colours texels, float ends[2][4], line_fit *best) {
    line_fit made = *best;
    for (int end = 0; end < 2; ++end) {
        float least = 1e30f;
        for (int p_bit = 0; p_bit < 2; ++p_bit) {
            float distance = 0.0f;
            int stored[4] = {0};
            for (int part = kind->first; part < kind->first + kind->count; ++part) {
                stored[part] = stored_end(kind, ends[end][part], p_bit);
                const float off = (float)expanded_end(kind, stored[part]) - ends[end][part];
                distance += off * off;
            }
            if (distance >= least) continue;
            least = distance;
            memcpy(made.ends[end], stored, sizeof stored);
        }
    }
    find_indices(kind, texels, 0xFFFFu, &made);
    if (made.error < best->error) *best = made;
}

/* Swaps the ends of a line if the highest bit of its anchor's index is 1: that bit is not stored. */
static void turn(const line_kind *kind, line_fit *line, int anchor) {
    const int most = (1 << kind->index_bits) - 1;
    if (line->indices[anchor] <= most / 2) return;
    for (int part = kind->first; part < kind->first + kind->count; ++part) {
        const int other = line->ends[0][part];
        line->ends[0][part] = line->ends[1][part];
        line->ends[1][part] = other;
    }
    for (int texel = 0; texel < 16; ++texel) line->indices[texel] = (uint8_t)(most - line->indices[texel]);
}

static void put_indices(bit_writer *out, const line_kind *kind, const line_fit *line) {
    for (int texel = 0; texel < 16; ++texel) put_bits(out, line->indices[texel], kind->index_bits - (texel == 0));
}

/* Writes mode 1 or 7: a line for each subset of a partition. */
static void write_lines(const line_kind *kind, const line_fit lines[2], int partition, uint8_t *block) {
    line_fit turned[2] = {lines[0], lines[1]};
    bit_writer out = {block, 0};
    turn(kind, &turned[0], 0);
    turn(kind, &turned[1], 15);
    put_bits(&out, kind == &MODE_1 ? 2u : 128u, kind == &MODE_1 ? 2 : 8);
    put_bits(&out, (uint32_t)partition, 6);
    for (int part = 0; part < kind->count; ++part) {
        for (int subset = 0; subset < 2; ++subset) {
            for (int end = 0; end < 2; ++end) put_bits(&out, (uint32_t)turned[subset].ends[end][part] >> 1, kind->bits);
        }
    }
    for (int subset = 0; subset < 2; ++subset) {
        for (int end = 0; end < kind->p_bits; ++end) put_bits(&out, (uint32_t)turned[subset].ends[end][0] & 1u, 1);
    }
    for (int texel = 0; texel < 16; ++texel)
        put_bits(&out, turned[PARTITIONS[partition] >> texel & 1].indices[texel], kind->index_bits - (texel == 0 || texel == 15));
}

/* Writes mode 5. `rotation` 1 to 3: red, green or blue was swapped with alpha. */
static void write_mode_5(line_fit rgb, line_fit alpha, int rotation, uint8_t *block) {
    bit_writer out = {block, 0};
    turn(&MODE_5_COLOURS, &rgb, 0);
    turn(&MODE_5_ALPHA, &alpha, 0);
    put_bits(&out, 32u, 6);
    put_bits(&out, (uint32_t)rotation, 2);
    for (int part = 0; part < 3; ++part) {
        for (int end = 0; end < 2; ++end) put_bits(&out, (uint32_t)rgb.ends[end][part], 7);
    }
    for (int end = 0; end < 2; ++end) put_bits(&out, (uint32_t)alpha.ends[end][3], 8);
    put_indices(&out, &MODE_5_COLOURS, &rgb);
    put_indices(&out, &MODE_5_ALPHA, &alpha);
}

static void write_mode_6(line_fit line, uint8_t *block) {
    bit_writer out = {block, 0};
    turn(&MODE_6, &line, 0);
    put_bits(&out, 64u, 7);
    for (int part = 0; part < 4; ++part) {
        for (int end = 0; end < 2; ++end) put_bits(&out, (uint32_t)line.ends[end][part] >> 1, 7);
    }
    for (int end = 0; end < 2; ++end) put_bits(&out, (uint32_t)line.ends[end][0] & 1u, 1);
    put_indices(&out, &MODE_6, &line);
}

/* Returns a line of mode 6 for all texels, with few tries of ends. */
static line_fit fit_line_quickly(colours texels) {
    float ends[2][4] = {{0}};
    line_fit best;
    memset(&best, 0, sizeof best);
    best.error = 1e30f;
    find_ends(&MODE_6, texels, 0xFFFFu, 4, ends);
    try_nearest_ends(&MODE_6, texels, ends, &best);
    if (refit(&MODE_6, texels, 0xFFFFu, &best, ends)) try_nearest_ends(&MODE_6, texels, ends, &best);
    return best;
}

/* Squared errors of mode 6, in steps of 1/255, up to which no other mode is tried. */
#define GOOD_ENOUGH 4.0f
#define GOOD_ENOUGH_QUICKLY 160.0f
#define PARTITIONS_FITTED 3

/* Writes the best of mode 6, mode 5 (unless opaque), and mode 1 (opaque) or 7 (else). */
static void compress_bc7(colours texels, int is_quick, uint8_t *block) {
    const line_fit one = is_quick ? fit_line_quickly(texels) : fit_line(&MODE_6, texels, 0xFFFFu);
    float best = one.error;
    int is_opaque = 1;
    for (int texel = 0; texel < 16; ++texel) is_opaque = is_opaque && texels[texel][3] >= 255.0f;
    memset(block, 0, 16);
    write_mode_6(one, block);
    if (best <= (is_quick ? GOOD_ENOUGH_QUICKLY : GOOD_ENOUGH)) return;
    for (int rotation = 0; rotation < 4 && !is_opaque; ++rotation) {
        float turned[16][4];
        memcpy(turned, texels, sizeof turned);
        for (int texel = 0; texel < 16 && rotation > 0; ++texel) {
            turned[texel][rotation - 1] = texels[texel][3];
            turned[texel][3] = texels[texel][rotation - 1];
        }
        const line_fit rgb = fit_line(&MODE_5_COLOURS, (const float(*)[4])turned, 0xFFFFu);
        const line_fit alpha = fit_line(&MODE_5_ALPHA, (const float(*)[4])turned, 0xFFFFu);
        if (rgb.error + alpha.error >= best) continue;
        best = rgb.error + alpha.error;
        memset(block, 0, 16);
        write_mode_5(rgb, alpha, rotation, block);
    }
    const line_kind *kind = is_opaque ? &MODE_1 : &MODE_7;
    float away[16], mean[4], axis[4];
    for (int number = 0; number < 16; ++number)
        away[number] = principal_axis(kind, texels, PARTITIONS[number], 3, mean, axis) +
                       principal_axis(kind, texels, 0xFFFFu & ~(uint32_t)PARTITIONS[number], 3, mean, axis);
    for (int round = 0; round < (is_quick ? 1 : PARTITIONS_FITTED); ++round) {
        int least = 0;
        for (int number = 1; number < 16; ++number) least = away[number] < away[least] ? number : least;
        away[least] = 1e30f;
        const line_fit lines[2] = {fit_line(kind, texels, 0xFFFFu & ~(uint32_t)PARTITIONS[least]),
                                   fit_line(kind, texels, PARTITIONS[least])};
        if (lines[0].error + lines[1].error >= best) continue;
        best = lines[0].error + lines[1].error;
        memset(block, 0, 16);
        write_lines(kind, lines, least, block);
    }
}

int ntc_compress(const uint8_t texels[64], ntc_block_format format, uint8_t *block) {
    float values[16][4], channel[16];
    const int is_quick = format >= NTC_BC4_QUICK;
    for (int at = 0; at < 64; ++at) values[at / 4][at % 4] = (float)texels[at];
    if (format == NTC_BC7 || format == NTC_BC7_QUICK) {
        compress_bc7((const float(*)[4])values, is_quick, block);
        return 16;
    }
    const int count = format == NTC_BC5 || format == NTC_BC5_QUICK ? 2 : 1;
    for (int part = 0; part < count; ++part) {
        for (int texel = 0; texel < 16; ++texel) channel[texel] = values[texel][part];
        compress_bc4(channel, is_quick, block + 8 * part);
    }
    return 8 * count;
}

ntc_status ntc_decode_blocks(const ntc_pack *pack, int texture_number, int mip, ntc_map map, ntc_block_format format, void *blocks,
                             size_t row_bytes) {
    if (texture_number < 0 || texture_number >= pack->texture_count) return NTC_BAD_ARGUMENT;
    const texture *from = &pack->textures[texture_number];
    int first = 0, count = 0;
    if (mip < 0 || mip >= from->info.mips || format < NTC_BC4 || format > NTC_BC7_QUICK) return NTC_BAD_ARGUMENT;
    for (int number = 0; number < from->info.map_count && count == 0; ++number) {
        if (from->info.maps[number] == map) count = from->info.map_channels[number];
        else first += from->info.map_channels[number];
    }
    if (count == 0) return NTC_BAD_ARGUMENT;
    const level *stored = &from->levels[mip];
    /* Grey is one channel, or two with alpha. */
    const int is_bc7 = format == NTC_BC7 || format == NTC_BC7_QUICK, is_bc4 = format == NTC_BC4 || format == NTC_BC4_QUICK;
    const int is_grey = is_bc7 && (count == 1 || (map == NTC_BASE && count == 2));
    uint8_t texels[8 * 8 * NTC_MOST_CHANNELS], four[64];
    /* 8x8 texels at a time: each block of the codec is decoded once. */
    for (int y = 0; y < stored->texel_height; y += 8) {
        for (int x = 0; x < stored->texel_width; x += 8) {
            const int width = stored->texel_width - x < 8 ? stored->texel_width - x : 8;
            const int height = stored->texel_height - y < 8 ? stored->texel_height - y : 8;
            const size_t row = (size_t)(width * from->info.channels);
            ntc_decode(pack, texture_number, mip, x, y, width, height, NTC_U8, texels, row);
            for (int part = 0; part < 4; ++part) {
                const int left = part % 2 * 4, top = part / 2 * 4;
                if (left >= width || top >= height) continue;
                for (int texel = 0; texel < 16; ++texel) {
                    const int column = left + texel % 4 < width ? left + texel % 4 : width - 1;
                    const int line = top + texel / 4 < height ? top + texel / 4 : height - 1;
                    const uint8_t *at = texels + (size_t)line * row + (size_t)(column * from->info.channels + first);
                    for (int channel = 0; channel < 4; ++channel) {
                        const int source = is_grey && channel < 3 ? 0 : is_grey && channel == 3 ? 1 : channel;
                        four[4 * texel + channel] = source < count ? at[source] : channel == 3 ? 255 : 0;
                    }
                }
                uint8_t *out = (uint8_t *)blocks + (size_t)((y + top) / 4) * row_bytes;
                out += (size_t)((x + left) / 4) * (is_bc4 ? 8u : 16u);
                ntc_compress(four, format, out);
            }
        }
    }
    return NTC_OK;
}
