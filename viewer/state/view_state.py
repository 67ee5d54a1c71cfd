"""The view as immutable values, with the colours of its maps. Commands change it; renderer, UI, scripts and `render` read it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Final, Literal

from msgspec import Meta

from ntc.codec.config import Precision as Precision
from ntc.metrics.block_compression import BLOCK_FORMATS
from viewer.scene.json_text import Share
from viewer.scene.model import Camera, Pose
from viewer.state.palettes import PaletteName
from viewer.state.setting import Arg, Setting

LARGEST_ZOOM = 64.0
ZOOM_STEP = 1.25
"""Factor of the magnification for one notch of the wheel."""


@dataclass(frozen=True)
class Zoom:
    """Magnified part of the picture. The camera stays where it is."""

    factor: float = 1.0
    """Magnification: screen pixels along a side of one picture pixel, 1 to 64."""
    centre: tuple[float, float] = (0.5, 0.5)
    """Place in the middle, as shares of the picture from its upper left corner."""

    @property
    def is_whole(self) -> bool:
        """True where the whole picture is shown."""
        return self.factor <= 1.0

    @property
    def corner(self) -> tuple[float, float]:
        """Upper left corner of the shown part, as shares of the picture. The part never leaves the picture."""
        half = 0.5 / self.factor
        x, y = (min(max(value, half), 1.0 - half) - half for value in self.centre)
        return x, y

    def window_to_image(self, x: float, y: float) -> tuple[float, float]:
        """Return the place of the picture that is shown at (x, y); both are shares from the upper left corner."""
        left, top = self.corner
        return left + x / self.factor, top + y / self.factor

    def image_to_window(self, x: float, y: float) -> tuple[float, float]:
        """Return the place that shows (x, y) of the picture. Inverse of `window_to_image`."""
        left, top = self.corner
        return (x - left) * self.factor, (y - top) * self.factor

    def moved(self, dx: float, dy: float) -> "Zoom":
        """Return the zoom after a drag by (dx, dy), as shares of the shown part."""
        left, top = self.corner
        half = 0.5 / self.factor
        return replace(self, centre=(left + half - dx / self.factor, top + half - dy / self.factor))

    def towards(self, x: float, y: float, notches: float) -> "Zoom":
        """Return the zoom after `notches` of the wheel (smaller if negative); the place at (x, y) stays."""
        factor = min(max(self.factor * ZOOM_STEP**notches, 1.0), LARGEST_ZOOM)
        at = self.window_to_image(x, y)
        half = 0.5 / factor
        return Zoom(factor, (at[0] - x / factor + half, at[1] - y / factor + half))


WHOLE = Zoom()
"""Zoom that shows the whole picture."""


OverlayKind = Literal["none", "divergence", "error-texture", "error-decoder"]
BlockName = Literal["8x8", "8x4", "16x4", "4x4"]
ScaleName = Literal["block", "picture"]

BLOCKS: Final[dict[BlockName, tuple[int, int]]] = {"8x8": (8, 8), "8x4": (8, 4), "16x4": (16, 4), "4x4": (4, 4)}
"""Blocks in which decoders are counted, (width, height) in pixels: waves of 64, 32, 64 and 16 lanes."""

MOST_OF_BLOCK: Final[dict[BlockName, int]] = {"8x8": 8, "8x4": 6, "16x4": 8, "4x4": 4}
"""Decoders at the end of the colour range for blocks of each shape, so that a colour means the same in every picture."""


MAPS: Final = {
    "divergence": "Number of decoders in each block of pixels.",
    "error-texture": "Error of each texture between A and B.",
    "error-decoder": "Error of each decoder between A and B.",
}
PALETTE_TEXTS: Final = {
    "green-red": "Green for few, red for many.",
    "viridis": "Dark violet for few, yellow for many; suits the colour-blind.",
}
BLOCK_TEXTS: Final = {
    name: f"Blocks of {name} pixels, as a wave of {width * height} lanes shades them."
    for name, (width, height) in BLOCKS.items()
}


@dataclass(frozen=True)
class Overlay:
    """Map over the picture, with its colours and scale."""

    kind: Annotated[
        OverlayKind,
        Setting(
            "overlay.kind",
            "Overlay map",
            "show a map over the picture: decoders per block, or the error of textures or decoders",
        ),
        Arg("kind of map", values=MAPS),
    ] = "none"
    opacity: Annotated[
        Share,
        Setting(
            "overlay.opacity",
            "Map opacity",
            "set the opacity of the map over the picture",
            "Opacity of the map over the picture, 0 to 1.",
        ),
        Arg("0 to 1", text="opacity %.2f"),
    ] = 1.0
    palette: Annotated[
        PaletteName,
        Setting(
            "overlay.palette",
            "Palette",
            "choose the palette of the maps",
            "Colours of the map. viridis suits the colour-blind.",
        ),
        Arg("palette", values=PALETTE_TEXTS),
    ] = "viridis"
    block: Annotated[
        BlockName,
        Setting(
            "overlay.block",
            "Block shape",
            "count decoders in blocks of this shape",
            "Shape of the blocks in which decoders are counted, width x height in pixels. A block stands for the pixels that the "
            "GPU shades together (a wave).",
        ),
        Arg("WIDTHxHEIGHT in pixels", values=BLOCK_TEXTS),
    ] = "8x8"
    scale: Annotated[
        ScaleName,
        Setting(
            "overlay.scale",
            "Colour range",
            "set the last colour of the divergence map: a fixed number of decoders, or the largest in the picture",
            "Upper end of the colours. block: a fixed number of decoders for each block shape. picture: the largest number in the "
            "picture.",
        ),
        Arg(
            "block: fixed number; picture: most decoders in this view",
            names={"block": "fixed range", "picture": "range of picture"},
        ),
    ] = "block"
    """End of the colour range: the fixed number in MOST_OF_BLOCK, or the most decoders of a block in the picture."""

    def most(self, maximum: int) -> int:
        """Return the decoders at the end of the colour range, at least 2; `maximum` is the most of a block in the picture."""
        return MOST_OF_BLOCK[self.block] if self.scale == "block" else max(2, maximum)

    def legend(self, maximum: int) -> tuple[str, ...]:
        """Return the numbers below the bar of colours; `maximum` is the most decoders of a block in the picture."""
        most = self.most(maximum)
        # Blocks with more decoders have the last colour.
        last = f"{most}+" if self.scale == "block" else str(most)
        return (*(str(decoders) for decoders in range(1, most)), last)


NO_OVERLAY: Final = Overlay()


Side = Literal["a", "b"]
DecodePath = Literal["forward", "deferred", "binned", "cached", "on-load"]
PathChoice = Literal["auto", "forward", "deferred", "binned", "cached", "on-load"]
EXACT_PATHS: Final[tuple[DecodePath, ...]] = ("forward", "deferred", "binned", "cached")
"""Paths that show what a pack holds; `on-load` adds the loss of block compression."""
FILTERED_PATHS: Final[tuple[PathChoice, ...]] = ("cached", "on-load")
"""Paths with the hardware's filter or an equal one, and anisotropy. Other paths use the slot's `filter`."""
CompareMode = Literal["a", "b", "wipe", "wipe-horizontal", "side-by-side", "difference"]
MODE_NAMES: Final[Mapping[str, str]] = {
    "a": "A",
    "b": "B",
    "wipe": "Left/right",
    "wipe-horizontal": "Above/below",
    "side-by-side": "Side by side",
    "difference": "Difference",
}
MODE_TEXTS: Final = {
    "a": "Show slot A alone.",
    "b": "Show slot B alone.",
    "wipe": "A left of the divider, B right of it. Drag the divider; a double-click centres it.",
    "wipe-horizontal": "A above the divider, B below it. Drag the divider; a double-click centres it.",
    "side-by-side": "The middle half of the picture from A on the left, and the same half from B on the right.",
    "difference": "Show the difference between A and B in each pixel.",
}
MaterialView = Literal["lit", "base", "normal", "orm", "emissive"]
VIEWS: Final[Mapping[MaterialView, str]] = {
    "lit": "lit surfaces",
    "base": "base colours without light",
    "normal": "normal maps as stored",
    "orm": "occlusion, roughness and metalness as red, green and blue",
    "emissive": "emitted light",
}
"""Views of the materials in a few words."""
ToneMap = Literal["neutral", "agx", "none"]
"""Tone map: Khronos PBR Neutral, AgX, or only clipping."""
DecodedMaps = Literal["all", "base", "normal", "roughness", "metalness", "emissive", "occlusion"]
DifferenceKind = Literal["raw", "amplified", "relative", "flip"]

Anisotropy = Literal[1, 2, 4, 8, 16]
DIFFERENCE_ARG: Final = Arg(
    "kind of difference",
    values={
        "raw": "|A - B| of sRGB values.",
        "amplified": "|A - B| of sRGB values times a gain.",
        "relative": "|A - B| / A of linear light: the error relative to the brightness of the pixel.",
        "flip": "FLIP: the difference that an eye sees when it flips between both pictures. Dark is 0, bright is 1.",
    },
)
PRECISION_ARG: Final = Arg(
    "number format of decoder weights and arithmetic; auto takes the fastest whose error stays below one 8-bit step",
    values={
        "auto": "The program measures and chooses.",
        "fp32": "32-bit numbers: exact.",
        "fp16": "Decoders are stored in 16-bit numbers; arithmetic is in 32 bits.",
        "fp16-arithmetic": "Storage and arithmetic in 16-bit numbers, sums in 32 bits.",
        "fp16-accumulate": "Storage, arithmetic and sums in 16-bit numbers: the fastest and least exact.",
    },
)
TexelFilter = Literal["exact", "stochastic"]
"""Trilinear as the codec defines it, or one texel of the footprint, chosen at random by its weight."""
FILTER_ARG: Final = Arg(
    "exact: all texels of the footprint; stochastic: one random texel, accumulated while the picture rests",
    name="texels",
    values={
        "exact": "All texels of a pixel's footprint.",
        "stochastic": "One random texel of the footprint; at rest the picture becomes exact.",
    },
)
SKY: Final = "sky"
STUDIO: Final = "studio"
BUILTIN_ENVIRONMENTS: Final = (SKY, STUDIO)
"""Names of the environments that need no file."""
REFERENCE: Final = "reference"
"""Name of the source that shows the original images."""


def is_image_source(source: str) -> bool:
    """Return True for sources that are drawn from images without decoding: the originals and block formats."""
    return source == REFERENCE or source in BLOCK_FORMATS


PATH_TEXTS: Final = {
    "auto": "The program measures and chooses.",
    "forward": "Decode in the material shader while surfaces are drawn, for every shaded pixel.",
    "deferred": "Find the visible surfaces first, then decode once for each pixel.",
    "binned": "Find the visible surfaces first, sort pixels by their decoder, then decode. Codec block gains nothing by it.",
    "cached": "Decode tiles of textures once and keep them; the graphics hardware filters them. Fast while the view changes little.",
    "on-load": "Decode textures once, compress them to BC7, BC5 and BC4, and let the graphics hardware sample them with anisotropy.",
}


@dataclass(frozen=True)
class Slot:
    """Side of the comparison: what it shows and how it is decoded."""

    source: str = REFERENCE
    """Source of the textures: REFERENCE, an encoded block format, or the name of an open pack."""
    path: Annotated[
        PathChoice,
        Setting(
            "slot.path",
            "Slot decode path",
            "choose the decode path of a slot",
            "How the latents are decoded for each frame. Paths differ in speed; their pictures are the same up to rounding. auto "
            "measures all and takes the fastest.",
        ),
        Arg("decode path", values=PATH_TEXTS),
    ] = "deferred"
    """Decode path; `auto` takes the fastest one as measured. No effect on images."""
    precision: Annotated[Precision, PRECISION_ARG] = "fp32"
    """Number format of decoder weights and arithmetic on the GPU. No effect on images."""
    filter: Annotated[
        TexelFilter,
        Setting(
            "slot.filter",
            "Slot texel filter",
            "filter a slot's texels exactly, or sample one at random",
            "Texture filter of all paths except cached and on-load. stochastic: one random texel of the footprint; the mean of "
            "16 samples is shown at rest.",
        ),
        FILTER_ARG,
    ] = "exact"
    """Texel filter of the paths that decode every pixel. No effect on path `cached` and images."""
    maps: Annotated[
        DecodedMaps,
        Setting(
            "slot.maps",
            "Slot maps",
            "decode all maps of a slot, or only one and keep the others original",
            "Decode all maps of the slot, or only one and keep the others original: you see what the error of that map does.",
        ),
        Arg("decoded maps: all, or only one"),
    ] = "all"
    """Maps that are decoded: all, or one with all others original, which shows what the error of that map does to the picture. No
    effect on the originals."""

    @property
    def label(self) -> str:
        """Source, path and precision in a few words."""
        if is_image_source(self.source):
            return self.source
        return f"{self.source}, {self.path}" + ("" if self.precision == "fp32" else f", {self.precision}")


@dataclass(frozen=True)
class Difference:
    """Measure of the difference between A and B."""

    kind: DifferenceKind = "amplified"
    """Kind of difference: |A - B| of sRGB values as it is or times `gain`, |A - B| / max(A, 0.01) of linear light, or FLIP."""
    gain: Annotated[
        float,
        Meta(ge=0.1, le=1000.0),
        Setting("compare.gain", "Difference gain", "set the factor of the amplified difference"),
        Arg("factor, 0.1 to 1000", ends=(1.0, 64.0), text="x %.1f", logarithmic=True),
    ] = 8.0


Azimuth = Annotated[
    float,
    Meta(ge=0.0, le=360.0),
    Setting("light.sun-azimuth", "Sun azimuth", "set the direction from which the sun shines"),
    Arg("degrees from north (-Z) towards east (+X)", wraps=True, name="azimuth", text="%.0f deg"),
]
Elevation = Annotated[
    float,
    Meta(ge=-10.0, le=90.0),
    Setting("light.sun-elevation", "Sun elevation", "set the height of the sun"),
    Arg("degrees above the horizon", clamp=True, name="elevation", text="%.0f deg"),
]


@dataclass(frozen=True)
class Lighting:
    """Light of the scene, exposure and tone map. No effect on the views of maps."""

    environment: Annotated[
        str,
        Arg(
            "light from all sides: `sky`, `studio` (soft boxes in a grey room) or an equirectangular panorama (.hdr or .exr)"
        ),
    ] = SKY
    """Environment: SKY, STUDIO, or the file of a panorama."""
    environment_turn: Annotated[
        float,
        Meta(ge=0.0, le=360.0),
        Setting("light.turn", "Turn environment", "turn studio or panorama about the vertical axis; the sky stays"),
        Arg("degrees", wraps=True, name="degrees", text="%.0f deg"),
    ] = 0.0
    """Turn of studio or panorama about the vertical axis, in degrees. No effect on SKY."""
    sun_azimuth: Azimuth = 140.0
    sun_elevation: Elevation = 40.0
    sun_strength: Annotated[
        float,
        Meta(ge=0.0, le=20.0),
        Setting(
            "light.sun-strength",
            "Sun strength",
            "set the strength of the sun: 1 is the usual one, 0 turns it off",
            "Factor on the sun's strength; 0 removes the sun.",
        ),
        Arg("factor, 0 to 20", name="strength", ends=(0.0, 4.0), text="x %.2f"),
    ] = 1.0
    exposure: Annotated[
        float,
        Meta(ge=-10.0, le=10.0),
        Setting(
            "light.exposure",
            "Exposure",
            "make the lit picture brighter or darker",
            "Exposure of the lit picture in stops; +1 is twice as bright.",
            icon="sun",
        ),
        Arg("stops: +1 is twice as bright", name="stops", ends=(-4.0, 4.0), text="%+.2f stops"),
    ] = 0.0
    tone_map: Annotated[
        ToneMap,
        Setting(
            "light.tone-map",
            "Tone map",
            "choose how light is mapped to the colours of the screen",
            "Tone map of the lit picture: Khronos PBR Neutral, AgX, or none, which clips.",
        ),
        Arg(
            "Khronos PBR Neutral, AgX, or only clipping",
            name="curve",
            values={
                "neutral": "Khronos PBR Neutral: keeps base colours unchanged.",
                "agx": "AgX: desaturates bright light as film does.",
                "none": "Clip bright light.",
            },
        ),
    ] = "neutral"


PictureAlone = Literal["shown", "a", "b", "split", "plain"]
"""Content of a picture without panels: as shown, side A, side B, both with the divider, or without overlay."""
DEFAULT_LIGHTING: Final = Lighting()


@dataclass(frozen=True)
class ViewState:
    """Values that determine a picture, given the scene and the open packs."""

    camera: Camera
    size: tuple[int, int]
    """Framebuffer (width, height) in pixels."""
    slot_a: Slot = Slot()
    slot_b: Slot = Slot()
    compare: Annotated[
        CompareMode,
        Setting(
            "compare.mode",
            "Compare mode",
            "show A, B, both with a divider, both side by side, or their difference",
            icon="table-columns",
        ),
        Arg("what is shown", name="mode", values=MODE_TEXTS, names=MODE_NAMES),
    ] = "a"
    wipe_position: Annotated[
        Share,
        Setting(
            "compare.divider",
            "Centre the divider",
            "move the divider to the middle, or to a share of the picture's width or height",
        ),
        Arg("place as a share of the width or height, 0 to 1", clamp=True, name="position"),
    ] = 0.5
    """Position of the divider as a share of the width or height; A is left of it or above it."""
    flipped: bool = False
    """True where both slots are shown in each other's place."""
    difference: Difference = Difference()
    overlay: Overlay = NO_OVERLAY
    highlight: tuple[int, ...] = ()
    """Ids of highlighted textures: everything else is dimmed. Empty dims nothing."""
    zoom: Zoom = WHOLE
    anisotropy: Annotated[
        Anisotropy,
        Setting(
            "filter.anisotropy",
            "Anisotropy",
            "set the anisotropic filtering of images and of paths cached and on-load, 1 (trilinear) to 16 samples",
            "Anisotropic filtering of images and of paths cached and on-load, 1 to 16 samples: surfaces at a slant stay sharp. "
            "1 is trilinear, the filter of all other paths.",
        ),
        Arg("1 is trilinear", name="value"),
    ] = 1
    material_view: Annotated[
        MaterialView,
        Setting(
            "materials.view",
            "Material view",
            "show lit surfaces, or one of the maps",
            "Picture of the materials: lit surfaces, or one of the maps (orm: occlusion, roughness, metalness).",
        ),
        Arg("what is shown", name="view", values={name: f"{text.capitalize()}." for name, text in VIEWS.items()}),
    ] = "base"
    lighting: Lighting = DEFAULT_LIGHTING
    pose: Pose | None = None
    """Time in an animation; None shows the scene without animation."""
    coarseness: int = 1
    """Factor by which a pixel is larger than at rest: above 1 in a preview while the camera moves."""

    @property
    def slots(self) -> dict[Side, Slot]:
        """Slots by side."""
        return {"a": self.slot_a, "b": self.slot_b}

    @property
    def block(self) -> tuple[int, int]:
        """Block in which decoders are counted, (width, height) in pixels; a preview's has fewer, but the same size on screen."""
        width, height = BLOCKS[self.overlay.block]
        return max(1, width // self.coarseness), max(1, height // self.coarseness)

    def alone(self, kind: PictureAlone) -> "ViewState":
        """Return the view to draw for a picture without panels."""
        if kind in ("a", "b"):
            return replace(self, compare=kind)
        if kind == "split":
            return replace(self, compare="wipe")
        return replace(self, overlay=NO_OVERLAY) if kind == "plain" else self

    def with_slot(self, side: Side, slot: Slot) -> "ViewState":
        """Return this view with another slot on one side."""
        return replace(self, slot_a=slot) if side == "a" else replace(self, slot_b=slot)

    def with_source(self, side: Side, source: str) -> "ViewState":
        """Return this view with another source on one side."""
        return self.with_slot(side, replace(self.slots[side], source=source))
