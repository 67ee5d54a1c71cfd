"""The state of the window: plain data that commands and events change, and everything else reads. No OpenGL, no UI."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from ntc.codec.model import Pack
from ntc.io import numbered_path
from ntc.metrics.block_compression import BLOCK_FORMATS, BlockFormat, named_format
from ntc.metrics.compressed_textures import CompressedTextures
from ntc.metrics.divergence import DivergenceStatistics
from viewer.scene.model import Camera, Scene
from viewer.state.message_log import MessageKind, MessageLog
from viewer.state.motion import AnimationPlayback, Motion
from viewer.state.settings import ViewerSettings
from viewer.state.view_state import REFERENCE, CompareMode, DecodedMaps, Side, Slot, ViewState

CANCEL = "Cancel"


@dataclass(frozen=True)
class Choice:
    """An answer, and the command that carries it out."""

    label: str
    """What its button says, one or two words."""
    command: str = ""
    """Id of the command; "" for none: the question is closed, and nothing else happens."""
    values: tuple[Any, ...] = ()
    """Of the command's parameters."""


@dataclass(frozen=True)
class Question:
    """What is asked. Everything else waits until it is answered; Escape takes the last choice."""

    title: str
    """One line."""
    text: str
    """What is at stake, one or more lines."""
    choices: tuple[Choice, ...]
    """The first is the safe one; the last leaves everything as it is."""


ErrorsBy = Literal["texture", "decoder"]
ErrorColumn = Literal["name", "decoder", "pixels", "psnr", "mean", "max"]


@dataclass(frozen=True)
class Toast:
    """A message that fades after a while."""

    text: str
    kind: MessageKind
    until: float | None = None
    """Monotonic time in seconds; None until a frame has shown it, so that a slow frame does not use up its time."""


@dataclass(frozen=True)
class SlotMeasurement:
    """The figures of one slot's picture."""

    source: str
    psnr_db: float | None
    """Against the reference picture, covered pixels, 8-bit sRGB; None for the reference itself."""
    divergence: DivergenceStatistics | None
    """None for images."""
    gpu_bytes: int | None
    """Latents, decoders and tables on the GPU; blocks of a block format, as hardware would take them; None for the reference."""
    psnr_by_map: Mapping[DecodedMaps, float | None] = field(default_factory=dict)
    """The same PSNR with one map decoded among the original ones, by map; None where that shows no error. Empty in the view `base`,
    and for images."""


@dataclass(frozen=True)
class PreviousView:
    """What was shown before a training run replaced it."""

    slot_a: Slot
    slot_b: Slot
    compare: CompareMode


@dataclass(frozen=True)
class PointedOut:
    """Textures that are shown for a while where they are in the picture: everything else is dimmed."""

    textures: tuple[int, ...]
    """Their ids."""
    seconds: float
    until: float | None = None
    """Monotonic time in seconds; None until a frame has shown them."""


@dataclass(frozen=True)
class ErrorTable:
    """What the panel Errors lists, and in which order."""

    by: ErrorsBy = "texture"
    column: ErrorColumn = "psnr"
    """By which the table is sorted."""
    descending: bool = False
    highlighted_decoder: int | None = None
    """The decoder whose textures are highlighted; None also where a texture is."""


@dataclass
class NavigationState:
    """How the camera moves."""

    motion: Motion | None = None
    """What moves the camera; None while it rests, or is moved by hand."""
    recording: tuple[Camera, ...] | None = None
    """The camera's path so far; None while it is not recorded."""
    last_path: tuple[Camera, ...] = ()
    """The path that was recorded last."""
    bookmarks: Mapping[str, Mapping[str, Camera]] = field(default_factory=dict)
    """Cameras that the user has named, by scene (its path, else its name) and by their own name."""
    speed_notches: float = 0.0
    """Notches of the wheel by which flying is faster than usual."""


@dataclass
class InspectionState:
    """What panels show details of. Places are shares of the picture's width and height from its upper left corner."""

    selected_texture: int | None = None
    """Texture id that panels highlight."""
    flat_texture: int | None = None
    """Texture id that is shown flat in a window of its own."""
    block: tuple[float, float] | None = None
    """Place of the block that stays in the panel Divergence."""
    pixel: tuple[float, float] | None = None
    """Place of the pixel that stays in the panel Pixel."""
    hovered: tuple[float, float] | None = None
    """Place of the mouse over the picture."""
    pointed_out: PointedOut | None = None
    measurements: Mapping[Side, SlotMeasurement] = field(default_factory=dict)
    measured_view: ViewState | None = None
    errors: ErrorTable = ErrorTable()


@dataclass
class WindowState:
    """The window around the picture."""

    log: MessageLog = field(default_factory=MessageLog)
    """All messages, toasts that have faded included."""
    toasts: tuple[Toast, ...] = ()
    panel_titles: tuple[str, ...] = ()
    """Of all panels, shown or not."""
    open_panels: frozenset[str] = frozenset()
    """Titles of those panels that are closed until they are asked for, and have been."""
    show_panels: bool = True
    column_folded: bool = False
    """Whether panels are folded to a strip at the edge of the window."""
    show_help: bool = False
    show_glossary: bool = False
    show_first_steps: bool = False
    """Whether the card of first steps is shown."""
    file_dialog: bool = False
    """Whether the dialog is open that chooses a file to open."""
    question: Question | None = None
    """What is to be answered before anything else; None for nothing."""
    palette: str | None = None
    """Id of the command whose arguments the palette asks for; "" while it lists all; None while it is closed."""
    show_other: bool = False
    """While a key is held: the other slot is shown."""
    flickers: bool = False
    """Whether A and B take turns."""
    flicker_phase: bool = False
    """Whether it is the other slot's turn."""
    picture_size: tuple[int, int] = (1, 1)
    """(width, height) in pixels that panels leave to the picture."""


@dataclass(eq=False)
class Session:
    """What is open, the view of it, and the state of the window around it."""

    scene: Scene
    packs: Mapping[str, Pack]
    """Open packs by their names; another object whenever one of them changes."""
    view: ViewState
    settings: ViewerSettings
    pictures_folder: Path = Path()
    """Where pictures, views and camera paths are written."""
    resolution: float = 1.0
    """Pixels of the picture along one side, as a share of the window's."""
    compressed: Mapping[BlockFormat, CompressedTextures] = field(default_factory=dict)
    """The scene's textures in block formats that slots have shown; another object whenever one is added."""
    awaited_formats: Mapping[Side, BlockFormat] = field(default_factory=dict)
    """Block formats that slots show once the textures are encoded."""
    precision_searches: frozenset[Side] = frozenset()
    """Slots whose cheapest precision that does not show is being searched."""
    seeks_first_view: bool = False
    """Whether a place in the scene is looked for that shows more than a view of all of it."""
    decoder_variant: str = ""
    """How decoders are laid out on the GPU, as the command line asks (`VariantChoice`); empty: as the environment says."""
    unsupported: Mapping[str, str] = field(default_factory=dict)
    """Precisions and decode paths that the graphics driver cannot compute in, each with the reason in a line."""
    previous_views: Mapping[str, PreviousView] = field(default_factory=dict)
    """What was shown before the first pack of each training run, by the name of its pack."""
    playback: AnimationPlayback = field(default_factory=AnimationPlayback)
    navigation: NavigationState = field(default_factory=NavigationState)
    inspection: InspectionState = field(default_factory=InspectionState)
    window: WindowState = field(default_factory=WindowState)

    @property
    def is_moving(self) -> bool:
        """Whether the camera or the scene moves by itself."""
        return self.navigation.motion is not None or (self.playback.is_playing and bool(self.scene.animations))

    @property
    def shown_view(self) -> ViewState:
        """The view to draw now: held key, flicker, and textures that are pointed out taken into account.

        One slot becomes the other; two change places; instead of the difference the slots themselves are shown.
        """
        view, window, pointed = self.view, self.window, self.inspection.pointed_out
        if pointed is not None and max(pointed.textures) < len(self.scene.textures):
            view = replace(view, highlight=pointed.textures)
        other = window.show_other != (window.flickers and window.flicker_phase)
        if view.compare == "difference" and (window.flickers or other):
            return replace(view, compare="b" if other else "a")
        if not other or view.compare == "difference":
            return view
        if view.compare in ("a", "b"):
            return replace(view, compare="a" if view.compare == "b" else "b")
        return replace(view, flipped=not view.flipped)

    @property
    def sources(self) -> tuple[str, ...]:
        """What a slot can be asked to show."""
        return (REFERENCE, *self.packs, *BLOCK_FORMATS)

    @property
    def open_sources(self) -> tuple[str, ...]:
        """What a slot can show at once."""
        return (REFERENCE, *self.packs, *self.compressed)

    def compressed_as(self, source: str) -> CompressedTextures | None:
        """The scene's textures in a block format, by the name of the source; None where it is none that is there."""
        block_format = named_format(source)
        return self.compressed.get(block_format) if block_format is not None else None

    @property
    def scene_key(self) -> str:
        """Identifies the scene among those that were open: its path, else its name."""
        return str(self.scene.path or self.scene.name)

    @property
    def bookmarks(self) -> Mapping[str, Camera]:
        """Cameras that the user has named, of this scene."""
        return self.navigation.bookmarks.get(self.scene_key, {})

    @property
    def present_settings(self) -> ViewerSettings:
        """The settings to remember."""
        return replace(
            self.settings,
            show_panels=self.window.show_panels,
            anisotropy=self.view.anisotropy,
            texel_filter=self.view.slot_a.filter,
            wipe_position=self.view.wipe_position,
            overlay=replace(self.view.overlay, kind="none"),
        )

    def file_to_read(self, file: Path) -> Path:
        """A file as given, else in the folder of pictures, where views and paths are written."""
        return file if file.is_absolute() or file.exists() else self.pictures_folder / file

    def dated_file(self, what: str, suffix: str) -> Path:
        """A file to write in the folder of pictures that is not there yet: the scene's name, `what`, and the time."""
        return numbered_path(self.pictures_folder / f"{self.scene.name}{what}-{time.strftime('%Y%m%d-%H%M%S')}{suffix}")
