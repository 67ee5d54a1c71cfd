"""What is open and how it is looked at: the one mutable thing behind the window. Knows neither OpenGL nor the UI."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from ntc.codec.precision import PrecisionChoice
from ntc.errors import InputError
from ntc.pack.file import read_pack
from ntc.pack.match import PackMatch, require_match
from ntc.pack.model import Pack
from viewer.inspect.measurement import SlotMeasurement
from viewer.scene.load import load_scene
from viewer.scene.model import Camera, Scene
from viewer.state.actions import (
    Action,
    InspectBlock,
    KeepPixel,
    MoveDivider,
    OpenFile,
    RunCommand,
    SetAnisotropy,
    SetCamera,
    SetCoarseWhileMoving,
    SetCompare,
    SetOverlay,
    SetResolution,
    SetSlot,
    SetZoom,
    Side,
)
from viewer.state.camera import frame_all
from viewer.state.camera_motion import Motion
from viewer.state.clipboard import Clipboard, LocalClipboard
from viewer.state.comparing_panels import ComparingPanels
from viewer.state.events import Event
from viewer.state.message_log import MessageKind, MessageLog, details_of
from viewer.state.pack_files import (
    PACK_SUFFIX,
    match_scene,
    packs_beside,
    preferred_source,
    same_place,
    source_of_grouping,
    unused_name,
)
from viewer.state.picture_request import PictureRequest
from viewer.state.settings import ViewerSettings
from viewer.state.view_state import REFERENCE, CompareMode, PathChoice, Slot, ViewState
from viewer.training.live_training import LiveTraining

TOAST_SECONDS = 6.0
LONGEST_PATH = 10_000
"""Cameras of a recorded path."""


@dataclass(frozen=True)
class Toast:
    """A message that fades after a while."""

    text: str
    kind: MessageKind
    until: float | None = None
    """Monotonic time in seconds; None until it has been seen, for a slow frame must not use up its time."""


@dataclass(frozen=True)
class FirstLook:
    """What slot A shows when a scene is opened."""

    grouping: str | None = None
    """REFERENCE or the grouping of an open pack; None: clustered, else the first pack, else the reference."""
    path: PathChoice = "deferred"
    precision: PrecisionChoice = "fp32"
    """`auto`: fp32 until the cheapest that does not show has been found."""


@dataclass(frozen=True)
class PreviousView:
    """What was shown before a training run replaced it."""

    slot_a: Slot
    slot_b: Slot
    compare: CompareMode


def _matching_pack(path: Path, scene: Scene) -> tuple[Pack, PackMatch]:
    """Read a pack that holds textures of `scene`. Raises InputError for any other."""
    pack = read_pack(path)
    match = match_scene(pack, scene)
    require_match(pack, match, scene.name)
    return pack, match


class Session:
    """An open scene with its packs, the view of it, and what the window says about it."""

    def __init__(self, scene: Scene, packs: Mapping[str, Pack], settings: ViewerSettings, first: FirstLook) -> None:
        self.settings = settings
        self.toasts: tuple[Toast, ...] = ()
        self.log = MessageLog()
        """All that was said, toasts that have faded included."""
        self.panel_titles: tuple[str, ...] = ()
        """All panels of the window, shown or not; set by what draws them."""
        self.raised_panel: str | None = None
        """The panel that is to come to the front."""
        self.layout_reset_requested = False
        self.selected_texture: int | None = None
        """Texture id that panels highlight."""
        self.flat_texture: int | None = None
        """Texture id that is shown flat in a window of its own."""
        self.measurements: dict[str, SlotMeasurement] = {}
        self.measured_view: ViewState | None = None
        self.measure_requested = False
        self.picture_requests: tuple[PictureRequest, ...] = ()
        """Pictures that the next frame is to write."""
        self.pictures_folder = Path()
        """Where they go; set by the frontend."""
        self.clipboard: Clipboard = LocalClipboard()
        """Set by the frontend."""
        self.motion: Motion | None = None
        """What moves the camera; None while it rests, or is moved by hand."""
        self.last_path: tuple[Camera, ...] = ()
        """The path that was recorded last."""
        self.palette: str | None = None
        """The command that the palette asks arguments for; "" while it lists all; None while it is closed."""
        self._bookmarks: dict[str, Mapping[str, Camera]] = {}
        self.recording: tuple[Camera, ...] | None = None
        """The camera's path so far; None while it is not recorded."""
        self.recorded_path: tuple[Camera, ...] | None = None
        """A whole path that is to be written."""
        self.closing = False
        self.show_panels = settings.show_panels
        self.show_help = False
        self.inspected: tuple[float, float] | None = None
        """Where the block is that stays inspected, as shares of the picture from its upper left corner."""
        self.hovered: tuple[float, float] | None = None
        """Where the mouse is over the picture, likewise."""
        self.showing_other = False
        """While held: the other slot is shown."""
        self.flickers = False
        """Whether A and B take turns."""
        self.flicker_phase = False
        """Whether it is the other slot's turn; kept up to date by the frontend."""
        self.comparing = ComparingPanels()
        self.kept_pixel: tuple[float, float] | None = None
        """Where the pixel is that stays in the panel Pixel, as shares of the picture from its upper left corner."""
        self.precision_wishes: frozenset[Side] = frozenset()
        """Slots that are to get the cheapest precision that does not show."""
        self.previous_views: Mapping[str, PreviousView] = {}
        """What was shown before the first pack of each training run, by the name of its pack."""
        self.training = LiveTraining(self._apply_event)
        self.resolution = 1.0
        self.picture_size = settings.window_size
        """(width, height) of the window's content, kept up to date by the frontend."""
        self._commands: Callable[[str, tuple[str, ...], Session], None] | None = None
        self._drawable: tuple[Scene, dict[str, Pack], ViewState] | None = None
        self._show(scene, dict(packs), first)

    def _show(self, scene: Scene, packs: dict[str, Pack], first: FirstLook) -> None:
        self.scene = scene
        self.packs = packs
        self.measurements = {}
        self.inspected = self.kept_pixel = None
        self.motion = None
        self.previous_views = {}
        self.precision_wishes = frozenset(("a",) if first.precision == "auto" else ())
        self.selected_texture = self.flat_texture = None
        source = self._first_source(first.grouping)
        camera = scene.cameras[0] if scene.cameras else frame_all(scene.bounds, self.settings.fov_degrees)
        self.view = ViewState(
            camera=camera,
            size=self.settings.window_size,
            slot_a=Slot(source, first.path, "fp32" if first.precision == "auto" else first.precision),
            slot_b=Slot(REFERENCE),
            compare="a" if source == REFERENCE else "wipe",
            wipe_position=self.settings.wipe_position,
            anisotropy=self.settings.anisotropy,
        )

    def _first_source(self, wanted: str | None) -> str:
        if wanted == REFERENCE:
            return REFERENCE
        found = source_of_grouping(self.packs, wanted) if wanted is not None else None
        return found or preferred_source(self.packs)

    @property
    def shown_view(self) -> ViewState:
        """The view to draw now, the held flip and the flicker taken into account.

        One slot becomes the other; two change places; instead of the difference the slots themselves are shown.
        """
        view, other = self.view, self.showing_other != (self.flickers and self.flicker_phase)
        if view.compare == "difference" and (self.flickers or other):
            return replace(view, compare="b" if other else "a")
        if not other or view.compare == "difference":
            return view
        if view.compare in ("a", "b"):
            return replace(view, compare="a" if view.compare == "b" else "b")
        return replace(view, flipped=not view.flipped)

    @property
    def sources(self) -> tuple[str, ...]:
        """What a slot can show."""
        return (REFERENCE, *self.packs)

    def use_commands(self, run: Callable[[str, tuple[str, ...], "Session"], None]) -> None:
        """How RunCommand is carried out: `viewer.commands.run_command`."""
        self._commands = run

    def run_command(self, command_id: str, arguments: tuple[str, ...] = ()) -> None:
        """Run a command by its id. Raises InputError."""
        if self._commands is not None:
            self._commands(command_id, arguments, self)

    @property
    def bookmarks(self) -> Mapping[str, Camera]:
        """Cameras that the user has named, of this scene."""
        return self._bookmarks.get(str(self.scene.path or self.scene.name), {})

    def keep_bookmarks(self, bookmarks: Mapping[str, Camera]) -> None:
        """Replace the bookmarks of this scene."""
        self._bookmarks[str(self.scene.path or self.scene.name)] = dict(bookmarks)

    def want_picture(self, request: PictureRequest) -> None:
        """Ask the next frame for a picture as a file."""
        self.picture_requests = (*self.picture_requests, request)

    def file_named(self, file: Path) -> Path:
        """A file to read: as given, else in the folder of pictures, where views and paths are written."""
        return file if file.is_absolute() or file.exists() else self.pictures_folder / file

    def dated_file(self, what: str, suffix: str) -> Path:
        """A file to write in the folder of pictures: the scene's name, `what`, and the time."""
        return self.pictures_folder / f"{self.scene.name}{what}-{time.strftime('%Y%m%d-%H%M%S')}{suffix}"

    def move_camera(self, seconds: float) -> None:
        """Let what moves the camera do so for `seconds`."""
        if self.motion is not None:
            camera, self.motion = self.motion.advance(self.view.camera, self.scene.bounds, seconds)
            self.view = replace(self.view, camera=camera)

    def say(self, text: str, kind: MessageKind = "message", details: str = "") -> None:
        """Show a message for a while, and keep it in the log with its details."""
        self.log.add(text, kind, details)
        self.toasts = (*self.toasts[-4:], Toast(text, kind))

    def forget_old_toasts(self, now: float) -> None:
        """Drop the messages whose time is over."""
        dated = (replace(toast, until=toast.until or now + TOAST_SECONDS) for toast in self.toasts)
        self.toasts = tuple(toast for toast in dated if toast.until is not None and toast.until > now)

    def apply(self, action: Action) -> None:
        """Do what the UI asks for. Bad input becomes a message; what was open stays."""
        match action:
            case SetSlot(side="a", slot=slot):
                self.view = replace(self.view, slot_a=slot)
            case SetSlot(slot=slot):
                self.view = replace(self.view, slot_b=slot)
            case SetCompare(mode=mode):
                self.view = replace(self.view, compare=mode)
            case MoveDivider(position=position):
                self.view = replace(self.view, wipe_position=min(max(position, 0.0), 1.0))
            case SetCamera(camera=camera):
                self.motion = None
                self.view = replace(self.view, camera=camera)
            case SetAnisotropy(value=value):
                self.view = replace(self.view, anisotropy=value)
            case SetOverlay(overlay=overlay):
                self.view = replace(self.view, overlay=overlay)
            case SetZoom(zoom=zoom):
                self.view = replace(self.view, zoom=zoom)
            case InspectBlock(at=at):
                self.inspected = at
            case KeepPixel(at=at):
                self.kept_pixel = at
            case SetResolution(share=share):
                self.resolution = share
            case SetCoarseWhileMoving(value=value):
                self.settings = replace(self.settings, coarse_while_moving=value)
            case RunCommand(id=command_id, arguments=arguments):
                try:
                    self.run_command(command_id, arguments)
                except InputError as error:
                    self.say(str(error), "error", details_of(error))
            case OpenFile(path=path):
                try:
                    self._open(path)
                except InputError as error:
                    self.say(str(error), "error", details_of(error))
                except (OSError, ValueError) as error:
                    # What no file can be called, and what fails where nobody looks for it.
                    self.say(f"{path}: cannot be opened ({error}); check the path", "error", details_of(error))

    def _open(self, path: Path) -> None:
        if path.suffix.lower() == PACK_SUFFIX:
            self._open_pack(path)
            return
        scene = load_scene(path)
        self._show(scene, self._packs_beside(scene, path), FirstLook())
        problems = len(scene.report.missing)
        self.say(f"opened {path.name}" + (f"; {problems} things missing, see Scene" if problems else ""))

    def _packs_beside(self, scene: Scene, path: Path) -> dict[str, Pack]:
        """The packs beside a scene that belong to it; the others are a message and do not keep the scene closed."""
        packs: dict[str, Pack] = {}
        for pack_path in packs_beside(path):
            try:
                pack, _ = _matching_pack(pack_path, scene)
                packs[unused_name(pack.grouping.name, pack_path, packs)] = pack
            except InputError as error:
                self.say(str(error), "error", details_of(error))
        return packs

    def _open_pack(self, path: Path) -> None:
        pack, match = _matching_pack(path, self.scene)
        same = [name for name, other in self.packs.items() if other.path is not None and same_place(other.path, path)]
        name = same[0] if same else unused_name(pack.grouping.name, path, self.packs)
        self.packs = {**self.packs, name: pack}
        self.view = replace(self.view, slot_a=replace(self.view.slot_a, source=name))
        self.say(f"opened {path.name} in slot A: {match.line()}")

    def record_camera(self) -> None:
        """Add the camera to the path that is recorded, if it has moved."""
        if self.recording is None or len(self.recording) >= LONGEST_PATH:
            return
        camera = replace(self.view.camera, name=f"path_{len(self.recording) + 1:04d}")
        if not self.recording or replace(self.recording[-1], name=camera.name) != camera:
            self.recording = (*self.recording, camera)

    def note_drawable(self) -> None:
        """Remember what is open as something that can be drawn."""
        self._drawable = (self.scene, self.packs, self.view)

    def put_away_undrawable(self) -> bool:
        """Go back to what could be drawn before, where a scene turns out not to be drawable; False if nothing could."""
        if self._drawable is None:
            return False
        self.scene, self.packs, self.view = self._drawable
        self.measurements = {}
        self.selected_texture = self.flat_texture = None
        return True

    def camera_numbered(self, number: int) -> Camera | None:
        """The scene's camera `number`, from 0, if there is one."""
        cameras = self.scene.cameras
        return cameras[number] if number < len(cameras) else None

    def _apply_event(self, event: Event) -> None:
        from viewer.state.event_handlers import apply_event

        apply_event(self, event)

    def close(self) -> None:
        """End what runs beside the window."""
        self.training.close()

    def present_settings(self) -> ViewerSettings:
        """The settings to remember."""
        return replace(
            self.settings,
            show_panels=self.show_panels,
            anisotropy=self.view.anisotropy,
            wipe_position=self.view.wipe_position,
        )
