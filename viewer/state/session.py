"""State of the window: plain data that commands and events change and everything else reads. No OpenGL, no UI."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta

from ntc.codec.gpu import VariantName
from ntc.codec.model import Pack
from ntc.io import numbered_path
from ntc.metrics.block_compression import BLOCK_FORMATS, BlockFormat, named_format
from ntc.metrics.compressed_textures import CompressedTextures
from ntc.metrics.divergence import DivergenceStatistics
from viewer.scene.model import Camera, Scene
from viewer.state.message_log import MessageKind, MessageLog
from viewer.state.motion import AnimationPlayback, Motion
from viewer.state.setting import Arg, Setting
from viewer.state.settings import ViewerSettings, with_last_pack
from viewer.state.view_state import REFERENCE, CompareMode, DecodedMaps, Side, Slot, ViewState

ErrorsBy = Literal["texture", "decoder"]
ErrorColumn = Literal["name", "decoder", "pixels", "psnr", "mean", "max"]


@dataclass(frozen=True)
class Toast:
    """Message over the picture that disappears after some seconds."""

    text: str
    kind: MessageKind
    until: float | None = None
    """Monotonic time of its end in seconds; None until a frame has shown it, so that a slow frame does not use up its time."""


@dataclass(frozen=True)
class SlotMeasurement:
    """Figures of one slot's picture."""

    source: str
    psnr_db: float | None
    """PSNR in dB against the reference picture, over covered pixels in 8-bit sRGB; None for the reference itself."""
    divergence: DivergenceStatistics | None
    """Divergence of the decoders; None for images."""
    gpu_bytes: int | None
    """Bytes on the GPU: latents, decoders and tables, or the blocks of a block format; None for the reference."""
    psnr_by_map: Mapping[DecodedMaps, float | None] = field(default_factory=dict)
    """PSNR in dB with only one map decoded and all others original, by map; None without an error. Empty in the view `base`, and
    for images."""
    file_bytes: int | None = None
    """Bytes of a pack's latents and decoders, or of the blocks of a block format; None for the reference."""
    bits: float | None = None
    """Stored bits per texel of mip 0 of a pack; None for images."""
    path: str = ""
    """Decode path; "" for images."""
    draw_ms: float | None = None
    """Time in ms to draw the slot whole; None where it was not measured."""
    compression_db: float | None = None
    """PSNR in dB of the compressed texels of path `on-load` against the decoded ones, all mips; None for other paths."""
    load_rate: float | None = None
    """Texels that path `on-load` decoded and compressed in a second; None for other paths."""


@dataclass(frozen=True)
class PreviousView:
    """Slots and mode of the view before a training run replaced them."""

    slot_a: Slot
    slot_b: Slot
    compare: CompareMode


@dataclass(frozen=True)
class PointedOut:
    """Textures that are highlighted for some seconds: everything else is dimmed."""

    textures: tuple[int, ...]
    """Ids of the textures."""
    seconds: float
    until: float | None = None
    """Monotonic time of the end in seconds; None until a frame has shown them."""


@dataclass(frozen=True)
class ErrorTable:
    """Rows and order of the panel Errors."""

    by: ErrorsBy = "texture"
    column: ErrorColumn = "psnr"
    """Column by which the table is sorted."""
    descending: bool = False
    highlighted_decoder: int | None = None
    """Decoder whose textures are highlighted; None where a texture or nothing is."""


@dataclass
class NavigationState:
    """State of moving, recording and bookmarking the camera."""

    motion: Motion | None = None
    """Motion of the camera; None while it rests or is moved by hand."""
    recording: tuple[Camera, ...] | None = None
    """Cameras of the path being recorded; None while none is."""
    last_path: tuple[Camera, ...] = ()
    """Cameras of the path that was recorded last."""
    bookmarks: Mapping[str, Mapping[str, Camera]] = field(default_factory=dict)
    """Bookmarked cameras by scene (its path, else its name) and by the camera's name."""
    speed_notches: float = 0.0
    """Notches of the wheel by which flying is faster than usual; negative is slower."""


@dataclass
class InspectionState:
    """Subjects of the panels' details. Places are shares of the picture's width and height from its upper left corner."""

    selected_texture: int | None = None
    """Id of the texture that panels highlight."""
    flat_texture: int | None = None
    """Id of the texture in the flat view."""
    block: tuple[float, float] | None = None
    """Place of the pinned block in the panel Divergence."""
    pixel: tuple[float, float] | None = None
    """Place of the pinned pixel in the panel Pixel."""
    hovered: tuple[float, float] | None = None
    """Place of the mouse over the picture."""
    pointed_out: PointedOut | None = None
    measurements: Mapping[Side, SlotMeasurement] = field(default_factory=dict)
    measured_view: ViewState | None = None
    errors: ErrorTable = ErrorTable()


@dataclass
class WindowState:
    """State of the window around the picture."""

    log: MessageLog = field(default_factory=MessageLog)
    """Log of all messages."""
    toasts: tuple[Toast, ...] = ()
    panel_titles: tuple[str, ...] = ()
    """Titles of all panels, shown or not."""
    open_panels: frozenset[str] = frozenset()
    """Titles of the open panels among those that are closed until the user opens them."""
    show_panels: Annotated[
        bool, Setting("window.panels", "Panels", "hide or show the panels", key="H", toggles=True)
    ] = True
    column_folded: bool = False
    """True where panels are folded to a strip at the edge of the window."""
    show_help: Annotated[
        bool,
        Setting(
            "help.keys",
            "Keys and mouse",
            "show all keys and mouse gestures",
            key="F1",
            second_key="Shift+/",
            toggles=True,
            icon="keyboard",
        ),
    ] = False
    show_glossary: Annotated[
        bool,
        Setting(
            "help.glossary",
            "Glossary",
            "explain PSNR, divergence, group, latents and other terms",
            toggles=True,
            icon="book",
        ),
    ] = False
    show_first_steps: Annotated[
        bool,
        Setting(
            "help.first-steps",
            "First steps",
            "show what this program is for, and three things to try",
            toggles=True,
            icon="circle-question",
        ),
    ] = False
    """True where the card of first steps is shown."""
    file_dialog: bool = False
    """True where the dialog for opening a file is shown."""
    palette: str | None = None
    """Id of the command whose arguments the palette asks for; "" while it lists all; None while it is closed."""
    show_other: bool = False
    """True while a held key shows the other slot."""
    flickers: Annotated[
        bool,
        Setting(
            "compare.toggle-flicker",
            "Flicker",
            "alternate between A and B",
            "Alternate between A and B: differences catch the eye.",
            "J",
            toggles=True,
        ),
    ] = False
    flicker_phase: bool = False
    """True while the flicker shows the other slot."""
    picture_size: tuple[int, int] = (1, 1)
    """Size (width, height) of the picture in pixels, as panels leave it."""


@dataclass(eq=False)
class Session:
    """Open files, the view of them, and the state of the window."""

    scene: Scene
    packs: Mapping[str, Pack]
    """Open packs by name; a new mapping whenever one changes."""
    view: ViewState
    settings: ViewerSettings
    pictures_folder: Path = Path()
    """Folder for pictures, views and camera paths."""
    resolution: Annotated[
        float,
        Meta(ge=0.05, le=1.0),
        Setting(
            "view.resolution",
            "Resolution",
            "draw fewer pixels than the window has, which is faster and coarser",
            "Drawn pixels along each side, as a share of the window's. Fewer pixels are faster and coarser.",
        ),
        Arg("share of the window's pixels along a side, 0.05 to 1", name="share", offers=(1.0, 0.5, 0.25)),
    ] = 1.0
    compressed: Mapping[BlockFormat, CompressedTextures] = field(default_factory=dict)
    """Scene's textures in block formats that slots have shown; a new mapping whenever one is added."""
    awaited_formats: Mapping[Side, BlockFormat] = field(default_factory=dict)
    """Block formats that slots show as soon as the textures are encoded."""
    precision_searches: frozenset[Side] = frozenset()
    """Slots whose fastest precision is being searched."""
    seeks_first_view: bool = False
    """True while a first view inside the scene is searched, which may show more than a view of all of it."""
    decoder_variant: VariantName | None = None
    """Layout of the decoding shaders, from the command line; None: that of the renderer."""
    unsupported: Mapping[str, str] = field(default_factory=dict)
    """Precisions and decode paths that the graphics driver lacks, each with the reason in a line."""
    previous_views: Mapping[str, PreviousView] = field(default_factory=dict)
    """Views before the first pack of each training run, by the name of its pack."""
    playback: AnimationPlayback = field(default_factory=AnimationPlayback)
    navigation: NavigationState = field(default_factory=NavigationState)
    inspection: InspectionState = field(default_factory=InspectionState)
    window: WindowState = field(default_factory=WindowState)

    @property
    def is_moving(self) -> bool:
        """True while the camera moves by itself or an animation plays."""
        return self.navigation.motion is not None or (self.playback.is_playing and bool(self.scene.animations))

    @property
    def shown_view(self) -> ViewState:
        """View to draw now, with held key, flicker and highlight applied.

        A single slot is replaced by the other; two slots change places; the difference is replaced by the slots.
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
        """Sources that a slot can be asked to show."""
        return (REFERENCE, *self.packs, *BLOCK_FORMATS)

    @property
    def open_sources(self) -> tuple[str, ...]:
        """Sources that a slot can show without encoding first."""
        return (REFERENCE, *self.packs, *self.compressed)

    def compressed_as(self, source: str) -> CompressedTextures | None:
        """Return the scene's textures in the block format `source`; None for other sources and before they are encoded."""
        block_format = named_format(source)
        return self.compressed.get(block_format) if block_format is not None else None

    @property
    def scene_key(self) -> str:
        """Key of the scene among those that were open: its path, else its name."""
        return str(self.scene.path or self.scene.name)

    @property
    def bookmarks(self) -> Mapping[str, Camera]:
        """Bookmarked cameras of this scene by name."""
        return self.navigation.bookmarks.get(self.scene_key, {})

    @property
    def present_settings(self) -> ViewerSettings:
        """Settings to save, with the present values of view and window."""
        settings, scene = self.settings, self.scene.path
        shown = (self.packs.get(slot.source) for slot in self.view.slots.values())
        path = next((pack.path for pack in shown if pack is not None and pack.path is not None), None)
        if scene is not None and path is not None:
            settings = with_last_pack(settings, scene, path)
        return replace(
            settings,
            show_panels=self.window.show_panels,
            anisotropy=self.view.anisotropy,
            texel_filter=self.view.slot_a.filter,
            wipe_position=self.view.wipe_position,
            overlay=replace(self.view.overlay, kind="none"),
        )

    def file_to_read(self, file: Path) -> Path:
        """Return `file` where it exists, else the file of that name in the folder of pictures."""
        return file if file.is_absolute() or file.exists() else self.pictures_folder / file

    def dated_file(self, what: str, suffix: str) -> Path:
        """Return a new file in the folder of pictures, named by the scene, `what` and the time."""
        return numbered_path(
            self.pictures_folder / f"{self.scene.title}{what}-{time.strftime('%Y%m%d-%H%M%S')}{suffix}"
        )
