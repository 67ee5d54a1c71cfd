"""Bindings, units, records and constants that Python and GLSL share. GLSL includes them as `generated/layout.glsl`."""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ntc.codec.gpu import decoding_layout_glsl, glsl_codes, glsl_struct
from ntc.codec.maps import MAPS, PLANES, TABLE_OF_MAP, MapName, neutral_plane
from viewer.gl.limits import GROUPS_ACROSS
from viewer.lighting.brdf import SMALLEST_COSINE, SMALLEST_ROUGHNESS
from viewer.lighting.prefilter import ENVIRONMENT_LEVELS, MOST_SAMPLES
from viewer.scene.model import AlphaMode, Sampler


class StorageBinding(IntEnum):
    """Binding points of shader storage buffers, besides those of `ntc.codec.gpu.DecodingBinding`. OpenGL guarantees only 8, so buffers
    of a single program have overlapping numbers, in the enumerations below."""

    MATERIALS = 0
    REQUESTS = 5
    RESULTS = 6
    DECODERS = 7


class BinBinding(IntEnum):
    """Storage bindings of path `binned`. They overlap those of buffers that its programs do not read."""

    BINS = 5
    BIN_PIXELS = 6


class TileBinding(IntEnum):
    """Storage bindings of path `cached`. Its decoding programs read no tables, the others no latents, so the numbers overlap."""

    MATERIAL_TILES = 3
    TILE_LEVELS = 4
    PAGE_USED = 5
    TILE_ENTRIES = 7


class UniformBinding(IntEnum):
    """Binding points of uniform buffers, besides those of `ntc.codec.gpu.DecodingUniform`."""

    LIGHTS = 1
    SAMPLES = 2


class TextureUnit(IntEnum):
    """Texture units."""

    SURFACE = 0
    SURFACE_COLOR = 1
    SURFACE_GRADIENTS = 2
    IMAGES = 3
    ALPHA = 4
    PICTURE_A = 5
    PICTURE_B = 6
    DIVERGENCE = 7
    ATLAS = 8
    FLIP = 9
    SURFACE_FRAME = 10
    SURFACE_SECOND_UVS = 11
    PLANE_BASE = 12
    PLANE_SURFACE = 13
    PLANE_EMISSION = 14
    OTHER_BASE = 15
    OTHER_SURFACE = 16
    OTHER_EMISSION = 17
    SURFACE_DEPTH = 18
    ENVIRONMENT = 19
    PANORAMA = 20
    BRDF_TABLE = 21
    SHADOW = 22
    SECOND_IMAGES = 23


class ImageUnit(IntEnum):
    """Image units of compute passes, besides those of `ntc.codec.gpu.DecodingImage`."""

    TARGET = 0
    DIVERGENCE = 1
    ATLAS = 3
    PLANES = 4


class AlphaCode(IntEnum):
    """Codes of alpha modes in GLSL."""

    OPAQUE = 0
    MASK = 1
    BLEND = 2


class SamplerFlag(IntEnum):
    """Bits of MaterialRecord.sampler_flags: how a material's filter differs from trilinear."""

    MAGNIFY_NEAREST = 1
    MINIFY_NEAREST = 2
    MIPMAP_NONE = 4
    MIPMAP_NEAREST = 8


ALPHA_CODES: dict[AlphaMode, AlphaCode] = {"opaque": AlphaCode.OPAQUE, "mask": AlphaCode.MASK, "blend": AlphaCode.BLEND}

GROUP_SIDE = 8
"""Side of a compute work group in pixels; the default block of the divergence map has the same."""
TEXEL_GROUP = 64
"""Number of invocations in a work group of the texel decoder."""
BIN_GROUP = 64
"""Number of invocations in a work group of the binned decode; each decodes several pixels."""
SCAN_GROUP = 256
"""Number of invocations in the single work group of a prefix sum."""
TILE_SIDE = 32
"""Side in texels of a tile of a decoded mip."""
PAGE_SIDE = TILE_SIDE + 1
"""Side in texels of a page of the tile atlas: a tile, and a border to the right and below for hardware filtering."""
PAGE_SQUARES = (TILE_SIDE // 2 + 1) ** 2
"""Number of 2x2 squares of texels that cover a page."""
ATLAS_SIDE = 1024
"""Side in texels of a layer of the tile atlas. With a power of two, coordinates of texels are exact in fp32."""
PAGES_ACROSS = ATLAS_SIDE // PAGE_SIDE
"""Number of pages along a side of a layer of the tile atlas."""
TILE_REQUESTED = 0xFFFFFFFF
"""Table entry of a missing tile that is requested. Other entries: 0 for a missing tile, else its page + 1."""
MAX_TILE_REQUESTS = 1 << 16
"""Most tiles that one frame can request; further ones are requested later."""
LATE_TILE_REQUESTS = 1 << 12
"""Most tiles that one frame can request if frames do not wait, because such a frame decodes few."""
PALETTE_STEPS = 32
"""Number of entries of a palette as shaders read it."""
MATERIAL_SHIFT = 16
"""Bit from which the visibility buffer's first word holds material + 1; below it is texture id + 1."""
LARGEST_ID = 65534
"""Largest number of textures, and of materials, in the visibility buffer."""
MOST_LIGHTS = 64
"""Most lights of a scene that are drawn, besides the sun."""
MAP_BITS: dict[MapName, int] = {name: 1 << number for number, name in enumerate(MAPS)}
"""Bit of each map in sets of maps."""
BUCKET_DEPTHS = 4096
"""Number of steps of depth by which the reference pass distinguishes texture arrays."""

PLANE_RECORD = np.dtype(
    [
        *((name, "<i4") for name in ("texture_id", "wrap_u", "wrap_v", "sampler_flags")),
        *((name, "<i4") for name in ("image_array", "image_layer", "components", "second_uvs")),
        *((name, "<f4", (4,)) for name in ("uv_u", "uv_v")),
    ]
)
"""Record of one plane of a material's maps: std430, 64 bytes. `components` has a bit for each component that the material reads;
the others are neutral. `uv_u` and `uv_v` hold (a, b, c, unused) of `PlaneTexture.uv_transform`."""

MATERIAL_RECORD = np.dtype(
    [
        *((name, "<f4", (4,)) for name in ("factor", "emissive", "surface", "specular")),
        ("alpha_cutoff", "<f4"),
        *((name, "<i4") for name in ("alpha_mode", "unlit", "missing_base")),
        *((name, "<f4") for name in ("clearcoat", "clearcoat_roughness")),
        *((name, "<i4") for name in ("alike", "padding_0")),
        ("planes", PLANE_RECORD, (len(PLANES),)),
    ]
)
"""Record of a material: std430, 288 bytes. `emissive`: RGB, strength of occlusion. `surface`: roughness, metalness, scale of normals,
transmission. `specular`: reflectance of a dielectric at normal incidence (RGB), and at grazing incidence.
`missing_base`: 1 if a checkerboard replaces the base colour. `alike`: two bits for each plane, the number of the first plane that
reads the same texture at the same texels."""

REQUEST_RECORD = np.dtype([("uv", "<f4", (2,)), ("lod", "<f4"), ("texture_wrap", "<i4")])
"""Record of one texel to decode: `texture_wrap` = texture * 16 + wrap_u * 4 + wrap_v."""

TILE_LEVEL_RECORD = np.dtype([("first_entry", "<i4"), ("across", "<i4")])
"""Record of the tiles of one mip under one pair of wrap modes: std430, 8 bytes. Tile (x, y) has entry first_entry + y * across + x."""

TILE_RECORD = np.dtype(
    [(name, "<i4") for name in ("texture_id", "level", "tile_x", "tile_y", "wrap_u", "wrap_v", "page", "entry")]
)
"""Record of a tile to decode: std430, 32 bytes."""

BIN_RECORD = np.dtype(
    [
        (name, "<u4")
        for name in ("groups_x", "groups_y", "groups_z", "pixels", "first", "counted", "placed", "padding_0")
    ]
)
"""Record of one decoder's bin: std430, 32 bytes. It starts with the arguments of an indirect dispatch. The bin has `pixels` entries
of the list from `first` on. `counted` and `placed` are counters while a frame is binned, and 0 between frames."""


def texture_ids_of(words: NDArray[np.uint32]) -> NDArray[np.int32]:
    """Return the texture ids in first words of the visibility buffer, any shape; -1 for none."""
    return (words & np.uint32((1 << MATERIAL_SHIFT) - 1)).astype(np.int32) - 1


def materials_of(words: NDArray[np.uint32]) -> NDArray[np.int32]:
    """Return the materials in first words of the visibility buffer, any shape; -1 for the background."""
    return (words >> np.uint32(MATERIAL_SHIFT)).astype(np.int32) - 1


def sampler_flags(sampler: Sampler) -> int:
    """Return the bits of SamplerFlag for a glTF sampler; 0 is trilinear."""
    flags = 0 if sampler.magnify_linear else SamplerFlag.MAGNIFY_NEAREST
    flags |= 0 if sampler.minify_linear else SamplerFlag.MINIFY_NEAREST
    flags |= {"none": SamplerFlag.MIPMAP_NONE, "nearest": SamplerFlag.MIPMAP_NEAREST, "linear": 0}[sampler.mipmap]
    return int(flags)


_NESTED = {PLANE_RECORD: "PlaneRecord"}


def scene_layout_glsl(groups_across: int = GROUPS_ACROSS) -> str:
    """Return the include `generated/layout.glsl`: bindings, units, codes and records that no codec changes.

    `groups_across`: work groups in a row of a dispatch, as `Limits` has them.
    """
    lines = [
        "// Generated from viewer/render/resources/layout.py.",
        '#include "generated/decoding.glsl"',
        *glsl_codes(
            (StorageBinding, "BINDING_"),
            (BinBinding, "BINDING_"),
            (TileBinding, "BINDING_"),
            (UniformBinding, "UNIFORM_"),
            (TextureUnit, "UNIT_"),
            (ImageUnit, "IMAGE_"),
            (AlphaCode, "ALPHA_"),
            (SamplerFlag, "SAMPLER_"),
        ),
    ]
    for name, bit in MAP_BITS.items():
        place = TABLE_OF_MAP[name]
        components = "rgba"[place.component : place.component + place.channels]
        lines += [f"#define MAP_{name.upper()} {bit}", f"#define {name.upper()}_COMPONENTS {components}"]
    lines += [f"#define NEUTRAL_{plane.upper()} vec4{neutral_plane(plane)}" for plane in PLANES]
    lines += [
        f"#define GROUP_SIDE {GROUP_SIDE}",
        f"#define ENVIRONMENT_LEVELS {ENVIRONMENT_LEVELS}",
        f"#define MOST_SAMPLES {MOST_SAMPLES}",
        f"#define MOST_LIGHTS {MOST_LIGHTS}",
        f"#define SMALLEST_ROUGHNESS {SMALLEST_ROUGHNESS}",
        f"#define SMALLEST_COSINE {SMALLEST_COSINE}",
        f"#define TEXEL_GROUP {TEXEL_GROUP}",
        f"#define BIN_GROUP {BIN_GROUP}",
        f"#define SCAN_GROUP {SCAN_GROUP}",
        f"#define GROUPS_ACROSS {groups_across}",
        f"#define TILE_SIDE {TILE_SIDE}",
        f"#define TILE_SHIFT {TILE_SIDE.bit_length() - 1}",
        f"#define PAGE_SIDE {PAGE_SIDE}",
        f"#define ATLAS_SIDE {ATLAS_SIDE}",
        f"#define PAGES_ACROSS {PAGES_ACROSS}",
        f"#define TILE_REQUESTED {TILE_REQUESTED}u",
        f"#define PALETTE_STEPS {PALETTE_STEPS}",
        f"#define MATERIAL_SHIFT {MATERIAL_SHIFT}",
        f"#define BUCKET_DEPTHS {BUCKET_DEPTHS}.0",
        glsl_struct("PlaneRecord", PLANE_RECORD),
        glsl_struct("MaterialRecord", MATERIAL_RECORD, _NESTED),
        glsl_struct("RequestRecord", REQUEST_RECORD),
        glsl_struct("BinRecord", BIN_RECORD),
        glsl_struct("TileLevelRecord", TILE_LEVEL_RECORD),
        glsl_struct("TileRecord", TILE_RECORD),
    ]
    return "\n".join(lines) + "\n"


def scene_includes(groups_across: int = GROUPS_ACROSS) -> dict[str, str]:
    """Return the generated includes of shaders that need no codec, by name."""
    return {
        "generated/decoding.glsl": decoding_layout_glsl(),
        "generated/layout.glsl": scene_layout_glsl(groups_across),
    }
