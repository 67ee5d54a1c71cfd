"""Settings that the window keeps from one run to the next, as JSON in the user's configuration folder."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal, get_args

from msgspec import Meta

from ntc.errors import InputError
from ntc.io import read_file, write_text
from viewer.locations import CONFIG_FOLDER_VARIABLE
from viewer.scene.json_text import Share, convert, parse_json
from viewer.state.view_state import NO_OVERLAY, Overlay, TexelFilter

CameraMode = Literal["orbit", "fly"]
Theme = Literal["dark", "light"]
SETTINGS_FILE = "settings.json"
LAYOUT_FILE = "layout.ini"

Anisotropy = Literal[1, 2, 4, 8, 16]
ANISOTROPIES = get_args(Anisotropy)
FOV_RANGE = (10.0, 120.0)
UI_SCALE_RANGE = (0.5, 3.0)
FLICKER_RANGE = (0.2, 30.0)
"""Hz."""
TILE_CACHE_MEGABYTES = (1, 16384)
MOST_PANELS = 64
LONGEST_TITLE = 64
LARGEST_WINDOW_SIDE = 16384
MOST_KEYS = 1000
MOST_RECENT = 10
LONGEST_PATH = 4096
LARGEST_FILE = 1 << 20
"""Bytes: a settings file is a few hundred; anything beyond this is not one."""
REMEDY = "it will be overwritten when the window closes"


@dataclass(frozen=True)
class ViewerSettings:
    """Immutable settings; every field has a default, so that an older file stays readable."""

    show_panels: bool = True
    """Show the panels when the window opens."""
    camera_mode: CameraMode = "orbit"
    """What the mouse does with the camera: orbit around a point, or fly."""
    fov_degrees: Annotated[float, Meta(ge=FOV_RANGE[0], le=FOV_RANGE[1])] = 60.0
    """Vertical field of view of the free camera, degrees."""
    anisotropy: int = 1
    """Anisotropic filtering of the reference and of path `cached`: 1 (trilinear) to 16."""
    texel_filter: TexelFilter = "exact"
    """Filter of slot A, of the paths that decode every pixel."""
    wipe_position: Share = 0.5
    """Divider of the wipe as a share of the picture's width."""
    overlay: Overlay = NO_OVERLAY
    """How maps over the picture look. A start shows none: its `kind` is "none"."""
    window_size: tuple[
        Annotated[int, Meta(ge=320, le=LARGEST_WINDOW_SIDE)], Annotated[int, Meta(ge=200, le=LARGEST_WINDOW_SIDE)]
    ] = (1280, 720)
    """Window (width, height) in screen units."""
    coarse_while_moving: bool = True
    """Draw fewer pixels while the camera moves, where a whole frame takes long."""
    tile_cache_megabytes: Annotated[int, Meta(ge=TILE_CACHE_MEGABYTES[0], le=TILE_CACHE_MEGABYTES[1])] = 256
    """Memory that path `cached` may keep decoded tiles in, for each pack that is shown with it."""
    live_figures: bool = True
    """Draw the hidden slot and compare A with B while the view does not change."""
    prepare_encoding: bool = True
    """Start the training process, and prepare the encoding that a scene without a pack is offered, before it is asked for."""
    flicker_hz: Annotated[float, Meta(ge=FLICKER_RANGE[0], le=FLICKER_RANGE[1])] = 2.0
    """Frequency in Hz of switching between A and B while they flicker."""
    ui_scale: Annotated[float, Meta(ge=UI_SCALE_RANGE[0], le=UI_SCALE_RANGE[1])] = 1.0
    """Size of text and widgets; 1 is the normal one."""
    theme: Theme = "dark"
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
    """Whether the column of panels is folded to a strip; None: as the width of the window suggests."""
    keys: Annotated[Mapping[str, str], Meta(max_length=MOST_KEYS)] = field(default_factory=dict)
    """Keyboard shortcuts that replace the default ones, by command id; "" for none."""
    first_steps: bool = True
    """Show the card of first steps when the window opens; closing the card turns it off."""
    recent_files: Annotated[
        tuple[Annotated[str, Meta(max_length=LONGEST_PATH)], ...], Meta(max_length=MOST_RECENT)
    ] = ()
    """Absolute paths of scenes and packs that were opened, the last one first."""

    def __post_init__(self) -> None:
        """Raises ValueError for an anisotropy that is not offered."""
        if self.anisotropy not in ANISOTROPIES:
            raise ValueError(f"anisotropy: must be one of {', '.join(map(str, ANISOTROPIES))}")


def parse_settings(text: str | bytes, file: str) -> ViewerSettings:
    """Settings from JSON text; unknown fields are ignored, absent ones take their default. Raises InputError."""
    return convert(parse_json(text, file, REMEDY), ViewerSettings, file, REMEDY)


def with_recent(settings: ViewerSettings, path: Path) -> ViewerSettings:
    """`settings` with `path` as the file that was opened last; unchanged where its name is no text or too long."""
    name = str(path.absolute())
    if len(name) > LONGEST_PATH or not name.isprintable():
        return settings
    others = (other for other in settings.recent_files if other != name)
    return replace(settings, recent_files=(name, *others)[:MOST_RECENT])


def load_settings(folder: Path) -> tuple[ViewerSettings, str | None]:
    """(settings in `folder`, problem): a broken file gives the defaults and one line that says why, else None."""
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
    """Make `folder` unless it is there. Raises InputError if it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be created ({error}); set {CONFIG_FOLDER_VARIABLE}") from error


def save_settings(folder: Path, settings: ViewerSettings) -> None:
    """Write `settings` into `folder`, atomically. Raises InputError if it cannot be written."""
    make_config_folder(folder)
    write_text(folder / SETTINGS_FILE, json.dumps(asdict(settings), indent=2) + "\n")
