// Stands in for the kernel's i915 driver with an Arc A770 (DG2), as far as Mesa's Vulkan driver asks before it compiles shaders.
// Loaded before all other libraries (LD_PRELOAD): answers ioctls of the kind 'd' and libdrm's questions for devices; nothing is run.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

enum { CHIP = 0x56a0, REVISION = 8, SLICES = 8, SUBSLICES = 4, UNITS = 16, INVALID = -22 };
enum { MEMORY_BITS = 40 };

// As in xf86drm.h.
typedef struct { uint16_t domain; uint8_t bus, device, function; } Place;
typedef struct { uint16_t vendor, device, subvendor, subdevice; uint8_t revision; } Chip;
typedef struct { char **nodes; int available, kind; Place *place; Chip *chip; } Device;

// As in drm.h and i915_drm.h.
typedef struct { int major, minor, patch; size_t name_length; char *name; size_t date_length; char *date; size_t text_length; char *text; } Version;
typedef struct { uint64_t capability, value; } Capability;
typedef struct { int32_t number; int *value; } Parameter;
typedef struct { uint32_t context, size; uint64_t number, value; } ContextParameter;
typedef struct { uint64_t size; uint32_t handle, flags; uint64_t extensions; } Creation;
typedef struct { uint32_t handle, padding; uint64_t offset, flags, extensions; } Mapping;
typedef struct { uint64_t size, available; } Aperture;
typedef struct { uint32_t count, flags; uint64_t items; } Query;
typedef struct { uint64_t number; int32_t length; uint32_t flags; uint64_t data; } Item;
typedef struct { uint16_t flags, slices, subslices, units, subslice_offset, subslice_stride, unit_offset, unit_stride; uint8_t data[1 + SLICES + SLICES * SUBSLICES * 2]; } Topology;
typedef struct { uint16_t kind, number; uint32_t reserved0; uint64_t flags, capabilities; uint16_t logical, reserved1[3]; uint64_t reserved2[3]; } Engine;
typedef struct { uint32_t count, reserved[3]; Engine engines[2]; } Engines;
typedef struct { uint16_t kind, number; uint32_t reserved0; uint64_t size, free, reserved1[8]; } Region;
typedef struct { uint32_t count, reserved[3]; Region regions[2]; } Regions;

static int memory = -1;
static uint64_t next_place = 1 << 16;
static uint64_t places[1 << 16];
static uint32_t next_handle = 1;

// A device whose node is a file in memory: buffers are mapped from it.
int drmGetDevice2(int file, uint32_t flags, Device **device) {
    static char node[64];
    static char *nodes[3] = {node, node, node};
    static Place place = {0, 0, 2, 0};
    static Chip chip = {0x8086, CHIP, 0x8086, CHIP, REVISION};
    static Device only = {nodes, 1 << 2, 0, &place, &chip};
    if (memory < 0) {
        memory = memfd_create("gpu", 0);
        if (memory < 0 || ftruncate(memory, 1ll << MEMORY_BITS)) return INVALID;
        snprintf(node, sizeof node, "/proc/self/fd/%d", memory);
    }
    *device = &only;
    return 0;
}
int drmGetDevices2(uint32_t flags, Device *devices[], int most) {
    return devices && most > 0 && drmGetDevice2(0, flags, devices) ? 0 : 1;
}
void drmFreeDevice(Device **device) { *device = NULL; }
void drmFreeDevices(Device *devices[], int count) {}

static void answer_text(char *to, size_t *length, const char *text) {
    if (to) memcpy(to, text, *length < strlen(text) ? *length : strlen(text));
    *length = strlen(text);
}

static int parameter(int number) {
    switch (number) {
    case 4: return CHIP;
    case 32: return REVISION;
    case 17: return 0;          // cache shared with the CPU
    case 18: return 3;          // address spaces
    case 28: return 10;         // command parser
    case 30: case 40: return 4; // ways of mapping
    case 33: return SLICES * SUBSLICES;
    case 34: return SLICES * SUBSLICES * UNITS;
    case 51: return 19200000;   // timestamps a second
    case 56: return 0;
    default: return 1;
    }
}

static int32_t item(const Item *asked) {
    Topology topology = {0, SLICES, SUBSLICES, UNITS, 1, 1, 1 + SLICES, 2, {0}};
    Engines engines = {2, {0}, {{.kind = 0}, {.kind = 1}}};
    Regions regions = {2, {0}, {{.kind = 0, .size = 16ull << 30, .free = 16ull << 30}, {.kind = 1, .size = 16ull << 30, .free = 16ull << 30}}};
    const void *answer;
    int32_t length;
    memset(topology.data, 0xff, sizeof topology.data);
    memset(topology.data + 1, (1 << SUBSLICES) - 1, SLICES);
    switch (asked->number) {
    case 1: case 6: answer = &topology; length = sizeof topology; break;
    case 2: answer = &engines; length = sizeof engines; break;
    case 4: answer = &regions; length = sizeof regions; break;
    default: return INVALID;
    }
    if (asked->length >= length) memcpy((void *)(uintptr_t)asked->data, answer, length);
    return length;
}

static int answer(unsigned number, void *given) {
    switch (number) {
    case 0x00: {
        Version *version = given;
        version->major = 1, version->minor = 6, version->patch = 0;
        answer_text(version->name, &version->name_length, "i915");
        answer_text(version->date, &version->date_length, "20201103");
        answer_text(version->text, &version->text_length, "stand-in");
        return 0;
    }
    case 0x0c: ((Capability *)given)->value = 1; return 0;
    case 0xbf: *(uint32_t *)given = 1; return 0;
    case 0x40 + 0x06: *((Parameter *)given)->value = parameter(((Parameter *)given)->number); return 0;
    case 0x40 + 0x1b: case 0x40 + 0x3c: {
        Creation *creation = given;
        if (next_handle >= sizeof places / sizeof *places) return -1;
        places[next_handle] = next_place;
        next_place += (creation->size + 0xffff) & ~0xffffull;
        creation->handle = next_handle++;
        return 0;
    }
    case 0x40 + 0x23: *(Aperture *)given = (Aperture){1ull << 48, 1ull << 48}; return 0;
    case 0x40 + 0x24: ((Mapping *)given)->offset = places[((Mapping *)given)->handle]; return 0;
    case 0x40 + 0x2d: *(uint32_t *)given = 1; return 0;
    case 0x40 + 0x33: ((uint32_t *)given)[5] = 0xffff; return 0;
    case 0x40 + 0x34: ((ContextParameter *)given)->value = ((ContextParameter *)given)->number == 3 ? 1ull << 48 : 0; return 0;
    case 0x40 + 0x39: {
        Item *items = (Item *)(uintptr_t)((Query *)given)->items;
        for (uint32_t i = 0; i < ((Query *)given)->count; ++i) items[i].length = item(&items[i]);
        return 0;
    }
    case 0x40 + 0x3a: ((uint32_t *)given)[3] = 1; return 0;
    default: return 0;
    }
}

int ioctl(int file, unsigned long request, ...) {
    va_list arguments;
    va_start(arguments, request);
    void *given = va_arg(arguments, void *);
    va_end(arguments);
    if (((request >> 8) & 0xff) == 'd') return answer(request & 0xff, given);
    return syscall(SYS_ioctl, file, request, given);
}
