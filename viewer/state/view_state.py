"""What the user looks at, as immutable values: read by the renderer, the UI, scripts and `render`; changed by commands."""

from dataclasses import dataclass, replace
from typing import Annotated, Final, Literal

from msgspec import Meta

from ntc.codec.config import Precision as Precision
from ntc.metrics.block_compression import BLOCK_FORMATS
from viewer.scene.json_text import Share
from viewer.scene.model import Camera, Pose
from viewer.state.palettes import PaletteName

LARGEST_ZOOM = 64.0
ZOOM_STEP = 1.25
"""Change of the magnification from one notch of the wheel."""


@dataclass(frozen=True)
class Zoom:
    """Which part of the picture is shown."""

    factor: float = 1.0
    """Shown pixels along a side of a pixel of the picture, 1 to 64."""
    centre: tuple[float, float] = (0.5, 0.5)
    """What is in the middle, as shares of the picture from its upper left corner."""

    @property
    def is_whole(self) -> bool:
        """Whether the whole picture is shown as it is."""
        return self.factor <= 1.0

    @property
    def corner(self) -> tuple[float, float]:
        """Upper left corner of what is shown, as shares of the picture; what is shown never leaves the picture."""
        half = 0.5 / self.factor
        x, y = (min(max(value, half), 1.0 - half) - half for value in self.centre)
        return x, y

    def window_to_image(self, x: float, y: float) -> tuple[float, float]:
        """What of the picture is shown at (x, y); both as shares from the upper left corner."""
        left, top = self.corner
        return left + x / self.factor, top + y / self.factor

    def image_to_window(self, x: float, y: float) -> tuple[float, float]:
        """Where (x, y) of the picture is shown: the inverse of `window_to_image`."""
        left, top = self.corner
        return (x - left) * self.factor, (y - top) * self.factor

    def moved(self, dx: float, dy: float) -> "Zoom":
        """The picture dragged by (dx, dy), as shares of what is shown."""
        left, top = self.corner
        half = 0.5 / self.factor
        return replace(self, centre=(left + half - dx / self.factor, top + half - dy / self.factor))

    def towards(self, x: float, y: float, notches: float) -> "Zoom":
        """Larger by `notches` of the wheel (smaller if negative), with what is shown at (x, y) staying there."""
        factor = min(max(self.factor * ZOOM_STEP**notches, 1.0), LARGEST_ZOOM)
        at = self.window_to_image(x, y)
        half = 0.5 / factor
        return Zoom(factor, (at[0] - x / factor + half, at[1] - y / factor + half))


WHOLE = Zoom()
"""The whole picture as it is."""


OverlayKind = Literal["none", "divergence", "error-texture", "error-decoder"]
BlockName = Literal["8x8", "8x4", "16x4", "4x4"]
ScaleName = Literal["block", "picture"]

BLOCKS: Final[dict[BlockName, tuple[int, int]]] = {"8x8": (8, 8), "8x4": (8, 4), "16x4": (16, 4), "4x4": (4, 4)}
"""(width, height) in pixels of the blocks that decoders are counted in: waves of 64, 32, 64 and 16 lanes."""

MOST_OF_BLOCK: Final[dict[BlockName, int]] = {"8x8": 8, "8x4": 6, "16x4": 8, "4x4": 4}
"""Decoders at the far end of the palette for blocks of each shape: one colour means the same number in every picture."""


@dataclass(frozen=True)
class Overlay:
    """What lies over the picture."""

    kind: OverlayKind = "none"
    """Nothing, the map of decoders per block, or the error of each texture or decoder between A and B."""
    opacity: Share = 1.0
    palette: PaletteName = "viridis"
    block: BlockName = "8x8"
    scale: ScaleName = "block"
    """What the map's palette ends at: as many decoders as MOST_OF_BLOCK says, or as the picture has."""

    def most(self, maximum: int) -> int:
        """Decoders at the far end of the palette, at least 2, where a block of the picture has at most `maximum`."""
        return MOST_OF_BLOCK[self.block] if self.scale == "block" else max(2, maximum)


NO_OVERLAY: Final = Overlay()


Side = Literal["a", "b"]
DecodePath = Literal["forward", "deferred", "binned", "cached"]
PathChoice = Literal["auto", "forward", "deferred", "binned", "cached"]
CompareMode = Literal["a", "b", "wipe", "wipe-horizontal", "side-by-side", "difference"]
MaterialView = Literal["lit", "base", "normal", "orm", "emissive"]
"""What of the materials is shown: lit surfaces, or one of the maps as it is stored (`orm`: occlusion, roughness, metalness as RGB)."""
ToneMap = Literal["neutral", "agx", "none"]
"""Khronos PBR Neutral, AgX, or clipping alone."""
DecodedMaps = Literal["all", "base", "normal", "roughness", "metalness", "emissive", "occlusion"]
DifferenceKind = Literal["raw", "amplified", "relative", "flip"]

TexelFilter = Literal["exact", "stochastic"]
"""Trilinear as the codec defines it, or one texel of the footprint, chosen at random by its weight."""

GAIN_RANGE: Final = (0.1, 1000.0)
"""Range of the factor of the amplified difference."""
ELEVATION_RANGE: Final = (-10.0, 90.0)
"""Of the sun, in degrees above the horizon."""
SUN_STRENGTH_RANGE: Final = (0.0, 20.0)
EXPOSURE_RANGE: Final = (-10.0, 10.0)
"""In stops."""
SKY: Final = "sky"
"""The environment that needs no file."""
REFERENCE: Final = "reference"
"""The slot source that shows the original images instead of a pack."""


def is_image_source(source: str) -> bool:
    """Whether a source is shown as images, and nothing is decoded: the originals, or a format of graphics hardware."""
    return source == REFERENCE or source in BLOCK_FORMATS


Gain = Annotated[float, Meta(ge=GAIN_RANGE[0], le=GAIN_RANGE[1])]


@dataclass(frozen=True)
class Slot:
    """One side of the comparison."""

    source: str = REFERENCE
    """REFERENCE, a block format in which the textures are there, or the name under which a pack is open."""
    path: PathChoice = "deferred"
    """Decode path, or `auto` for the one that is measured to be fastest here; of no effect for images."""
    precision: Precision = "fp32"
    """Storage of decoder weights, and arithmetic with them, on the GPU; of no effect for images."""
    filter: TexelFilter = "exact"
    """Of the paths that decode every pixel; of no effect for path `cached` and images."""
    maps: DecodedMaps = "all"
    """Which maps are the pack's: all, or one of them, the others being those of the original images. So one sees what one map's error
    does to the picture. Of no effect for the originals."""


@dataclass(frozen=True)
class Difference:
    """How the difference of A and B is shown."""

    kind: DifferenceKind = "amplified"
    """|A - B| of sRGB values as it is, or `gain` times it; |A - B| / max(A, 0.01) of linear light; the FLIP map."""
    gain: Gain = 8.0


@dataclass(frozen=True)
class Lighting:
    """What lights the scene, and how light becomes a picture; of no effect for the views of maps."""

    environment: str = SKY
    """SKY, the sky that the sun makes, or a file of an equirectangular panorama (HDR or EXR)."""
    environment_turn: Annotated[float, Meta(ge=0.0, le=360.0)] = 0.0
    """Degrees that a panorama is turned by about the vertical axis; of no effect for SKY."""
    sun_azimuth: Annotated[float, Meta(ge=0.0, le=360.0)] = 140.0
    """Degrees from north (-Z) towards east (+X): where the sun stands."""
    sun_elevation: Annotated[float, Meta(ge=ELEVATION_RANGE[0], le=ELEVATION_RANGE[1])] = 40.0
    """Degrees above the horizon."""
    sun_strength: Annotated[float, Meta(ge=SUN_STRENGTH_RANGE[0], le=SUN_STRENGTH_RANGE[1])] = 1.0
    """Times the sun's own radiance; 0 leaves it out."""
    exposure: Annotated[float, Meta(ge=EXPOSURE_RANGE[0], le=EXPOSURE_RANGE[1])] = 0.0
    """In stops: radiance is multiplied by 2 to this power."""
    tone_map: ToneMap = "neutral"


PictureAlone = Literal["shown", "a", "b", "split", "plain"]
"""A picture without the window around it: as shown, of one side, of both with the divider, without overlay."""
DEFAULT_LIGHTING: Final = Lighting()


@dataclass(frozen=True)
class ViewState:
    """Everything that determines a picture, given the scene and the open packs."""

    camera: Camera
    size: tuple[int, int]
    """Framebuffer (width, height) in pixels."""
    slot_a: Slot = Slot()
    slot_b: Slot = Slot()
    compare: CompareMode = "a"
    wipe_position: float = 0.5
    """Divider of the wipe as a share of the width or height: A is left of it or above it."""
    flipped: bool = False
    """Where both slots are shown, each is in the other's place."""
    difference: Difference = Difference()
    overlay: Overlay = NO_OVERLAY
    highlight: tuple[int, ...] = ()
    """Ids of textures: everything else is dimmed. Empty: nothing is."""
    zoom: Zoom = WHOLE
    anisotropy: int = 1
    """Anisotropic filtering of images and of path `cached`: 1 (trilinear, as the other paths filter) to 16."""
    material_view: MaterialView = "base"
    lighting: Lighting = DEFAULT_LIGHTING
    pose: Pose | None = None
    """The moment of an animation at which the scene stands; None: as it was read."""
    coarseness: int = 1
    """Pixels of the picture at rest along one side of a pixel: more than 1 in a preview while the camera moves."""

    @property
    def slots(self) -> dict[Side, Slot]:
        """Both slots, by their side."""
        return {"a": self.slot_a, "b": self.slot_b}

    @property
    def block(self) -> tuple[int, int]:
        """(width, height) in pixels of the blocks that decoders are counted in: fewer in a preview, but as large on screen."""
        width, height = BLOCKS[self.overlay.block]
        return max(1, width // self.coarseness), max(1, height // self.coarseness)

    def alone(self, kind: PictureAlone) -> "ViewState":
        """The view to draw for a picture without the window, where this one is shown."""
        if kind in ("a", "b"):
            return replace(self, compare=kind)
        if kind == "split":
            return replace(self, compare="wipe")
        return replace(self, overlay=NO_OVERLAY) if kind == "plain" else self

    def with_slot(self, side: Side, slot: Slot) -> "ViewState":
        """This view with another slot on one side."""
        return replace(self, slot_a=slot) if side == "a" else replace(self, slot_b=slot)

    def with_source(self, side: Side, source: str) -> "ViewState":
        """This view with another source in the slot of one side."""
        return self.with_slot(side, replace(self.slots[side], source=source))
