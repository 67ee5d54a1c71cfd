"""Settings that the window keeps between runs, as JSON in the user's configuration folder."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta

from ntc.errors import InputError
from ntc.io import read_file, write_text
from viewer.locations import CONFIG_FOLDER_VARIABLE
from viewer.scene.json_text import Share, convert, parse_json
from viewer.state.setting import Arg, Setting
from viewer.state.view_state import Anisotropy, Overlay, TexelFilter

CameraMode = Literal["orbit", "fly"]
Theme = Literal["dark", "light"]
SETTINGS_FILE = "settings.json"
LAYOUT_FILE = "layout.ini"

FIRST_OVERLAY = Overlay(opacity=0.6)
"""The picture stays readable below a map."""
FOV_RANGE = (10.0, 120.0)
FLICKER_RANGE = (0.2, 30.0)
"""Range of the flicker's frequency in Hz."""
TILE_CACHE_MEGABYTES = (1, 16384)
ON_OR_OFF = Arg("on or off", name="state")
MOST_PANELS = 64
LONGEST_TITLE = 64
LARGEST_WINDOW_SIDE = 16384
MOST_KEYS = 1000
MOST_RECENT = 10
MOST_LAST_PACKS = 100
LONGEST_PATH = 4096
LARGEST_FILE = 1 << 20
"""Largest settings file in bytes; a usual one has a few hundred."""
REMEDY = "it will be overwritten when the window closes"


@dataclass(frozen=True)
class ViewerSettings:
    """Immutable settings; every field has a default, so that an older file stays readable."""

    show_panels: bool = True
    """Show the panels when the window opens."""
    camera_mode: Annotated[
        CameraMode,
        Setting("camera.mode", "Orbit or fly", "choose whether the mouse orbits, or looks around while keys fly"),
        Arg(
            "mode of the camera",
            name="mode",
            values={
                "orbit": "The mouse turns the camera around its target.",
                "fly": "The mouse looks around; W A S D Q E move.",
            },
        ),
    ] = "orbit"
    """Mode of the camera: the mouse orbits around a point, or looks around while keys fly."""
    fov_degrees: Annotated[
        float, Meta(ge=FOV_RANGE[0], le=FOV_RANGE[1]), Arg("vertical field of view of the camera in degrees")
    ] = 60.0
    """Vertical field of view of the free camera, degrees."""
    anisotropy: Anisotropy = 1
    """Anisotropic filtering of the reference and of path `cached`: 1 (trilinear) to 16."""
    texel_filter: TexelFilter = "exact"
    """Filter of slot A, of the paths that decode every pixel."""
    wipe_position: Share = 0.5
    """Position of the divider as a share of the picture's width or height."""
    overlay: Overlay = FIRST_OVERLAY
    """Appearance of maps over the picture. Its `kind` is "none": a start shows no map."""
    window_size: tuple[
        Annotated[int, Meta(ge=320, le=LARGEST_WINDOW_SIDE)], Annotated[int, Meta(ge=200, le=LARGEST_WINDOW_SIDE)]
    ] = (1280, 720)
    """Window (width, height) in screen units."""
    coarse_while_moving: Annotated[
        bool,
        Setting(
            "view.coarse-while-moving",
            "Coarser while moving",
            "draw fewer pixels while the camera moves, if full frames are slow",
            "Draw a quarter of the pixels along each side while the camera moves, if a full frame takes longer than 0.12 s.",
        ),
        ON_OR_OFF,
    ] = True
    """Draw fewer pixels while the camera moves, where a whole frame takes long."""
    tile_cache_megabytes: Annotated[int, Meta(ge=TILE_CACHE_MEGABYTES[0], le=TILE_CACHE_MEGABYTES[1])] = 256
    """Memory in MB for decoded tiles of path `cached`, for each pack that uses it."""
    live_figures: Annotated[
        bool,
        Setting(
            "compare.live",
            "Live figures",
            "measure A against B whenever the picture rests",
            "Measure A against B whenever the picture rests. Off: the figures below stay empty.",
        ),
        ON_OR_OFF,
    ] = True
    """Draw the hidden slot and compare A with B while the view does not change."""
    prepare_encoding: Annotated[
        bool,
        Setting(
            "training.ahead",
            "Prepare encoding early",
            "start the training process and prepare encoding as soon as a scene without a pack is open",
        ),
        ON_OR_OFF,
    ] = True
    """Start the training process and prepare encoding as soon as a scene without a pack is open."""
    flicker_hz: Annotated[float, Meta(ge=FLICKER_RANGE[0], le=FLICKER_RANGE[1])] = 2.0
    """Frequency of the flicker between A and B in Hz."""
    ui_scale: Annotated[
        float,
        Meta(ge=0.5, le=3.0),
        Setting("window.ui-scale", "Text size", "scale text and widgets"),
        Arg("scale of text and widgets, 1 is the normal size", name="scale"),
    ] = 1.0
    """Scale of text and widgets; 1 is the normal size."""
    theme: Annotated[
        Theme,
        Setting("window.theme", "Theme", "choose dark or light panels"),
        Arg(
            "colours of the panels",
            values={"dark": "Light text on dark panels.", "light": "Dark text on light panels."},
        ),
    ] = "dark"
    """Colours of the panels: dark or light."""
    hidden_panels: Annotated[
        tuple[Annotated[str, Meta(max_length=LONGEST_TITLE)], ...], Meta(max_length=MOST_PANELS)
    ] = ()
    """Titles of panels that are closed."""
    folded_panels: Annotated[
        tuple[Annotated[str, Meta(max_length=LONGEST_TITLE)], ...], Meta(max_length=MOST_PANELS)
    ] = ()
    """Titles of panels whose stacks are folded to their tabs."""
    column_folded: bool | None = None
    """True where the column of panels is folded to a strip; None folds it in a narrow window."""
    keys: Annotated[Mapping[str, str], Meta(max_length=MOST_KEYS)] = field(default_factory=dict)
    """Keys that replace the default ones, by command id; "" removes the key."""
    first_steps: bool = True
    """Show the card of first steps when the window opens. Closing the card turns this off."""
    recent_files: Annotated[
        tuple[Annotated[str, Meta(max_length=LONGEST_PATH)], ...], Meta(max_length=MOST_RECENT)
    ] = ()
    """Absolute paths of scenes and packs that were opened, the last one first."""
    last_packs: Annotated[Mapping[str, str], Meta(max_length=MOST_LAST_PACKS)] = field(default_factory=dict)
    """Absolute path of the pack that was shown last in each scene, by the absolute path of the scene."""


def parse_settings(text: str | bytes, file: str) -> ViewerSettings:
    """Parse settings from JSON; unknown fields are ignored, absent ones take their default. Raises InputError."""
    return convert(parse_json(text, file, REMEDY), ViewerSettings, file, REMEDY)


def with_recent(settings: ViewerSettings, path: Path) -> ViewerSettings:
    """Return `settings` with `path` first in the recent files; unchanged for a path that is not printable or too long."""
    name = str(path.absolute())
    if len(name) > LONGEST_PATH or not name.isprintable():
        return settings
    others = (other for other in settings.recent_files if other != name)
    return replace(settings, recent_files=(name, *others)[:MOST_RECENT])


def with_last_pack(settings: ViewerSettings, scene: Path, pack: Path) -> ViewerSettings:
    """Return `settings` with `pack` as the one that was shown last in `scene`."""
    key, value = str(scene.absolute()), str(pack.absolute())
    if settings.last_packs.get(key) == value or not (key + value).isprintable() or len(key + value) > LONGEST_PATH:
        return settings
    others = [(name, path) for name, path in settings.last_packs.items() if name != key]
    return replace(settings, last_packs=dict([*others, (key, value)][-MOST_LAST_PACKS:]))


def load_settings(folder: Path) -> tuple[ViewerSettings, str | None]:
    """Load (settings, problem) from `folder`; a broken file gives the defaults and the reason in a line, else None."""
    file = folder / SETTINGS_FILE
    try:
        if not file.exists():
            return ViewerSettings(), None
        return parse_settings(read_file(file, LARGEST_FILE), str(file)), None
    except InputError as error:
        return ViewerSettings(), f"{error}; using default settings"
    except OSError as error:
        return ViewerSettings(), f"{file}: cannot be read ({error.strerror}); using default settings"


def make_config_folder(folder: Path) -> None:
    """Create `folder` where it is absent. Raises InputError where that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be created ({error}); set {CONFIG_FOLDER_VARIABLE}") from error


def save_settings(folder: Path, settings: ViewerSettings) -> None:
    """Write `settings` into `folder`, atomically. Raises InputError where that fails."""
    make_config_folder(folder)
    write_text(folder / SETTINGS_FILE, json.dumps(asdict(settings), indent=2) + "\n")
