"""What the window remembers from one run to the next, as JSON in the user's configuration folder."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

from ntc.errors import InputError
from ntc.io import write_text
from ntc.reading import read_file
from viewer.locations import CONFIG_FOLDER_VARIABLE

CameraMode = Literal["orbit", "fly"]
Theme = Literal["dark", "light"]
SETTINGS_FILE = "settings.json"
LAYOUT_FILE = "layout.ini"

ANISOTROPIES = (1, 2, 4, 8, 16)
FOV_RANGE = (10.0, 120.0)
UI_SCALE_RANGE = (0.5, 3.0)
FLICKER_RANGE = (0.2, 30.0)
"""Hz."""
GAIN_RANGE = (0.1, 1000.0)
"""Of the amplified difference."""
TILE_CACHE_MEGABYTES = (1, 16384)
MOST_PANELS = 64
LONGEST_TITLE = 64
SMALLEST_WINDOW = (320, 200)
LARGEST_WINDOW = (16384, 16384)
MOST_KEYS = 1000
LARGEST_FILE = 1 << 20
"""Bytes: a settings file is a few hundred; anything beyond this is not one."""


@dataclass(frozen=True)
class ViewerSettings:
    """Immutable settings; every field has a default, so that an older file stays readable."""

    show_panels: bool = True
    camera_mode: CameraMode = "orbit"
    fov_degrees: float = 60.0
    """Vertical field of view of the free camera, degrees."""
    anisotropy: int = 1
    """Anisotropic filtering of the reference and of path `cached`: 1 (trilinear) to 16."""
    wipe_position: float = 0.5
    """Divider of the wipe as a share of the picture's width."""
    window_size: tuple[int, int] = (1280, 720)
    """Window (width, height) in screen units."""
    coarse_while_moving: bool = True
    """Draw fewer pixels while the camera moves, where a whole frame takes long."""
    tile_cache_megabytes: int = 256
    """Memory that path `cached` may keep decoded tiles in, for each pack that is shown with it."""
    live_figures: bool = True
    """Draw the hidden slot and compare A with B while the picture rests."""
    flicker_hz: float = 2.0
    """How often a second A and B both are shown while they flicker."""
    ui_scale: float = 1.0
    """Size of text and widgets; 1 is the normal one."""
    theme: Theme = "dark"
    hidden_panels: tuple[str, ...] = ()
    """Titles of panels that are closed."""
    keys: Mapping[str, str] = field(default_factory=dict)
    """Keys in the place of the commands' own, by command id; "" for none."""


def _number(value: Any, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise ValueError(f"must be a number from {low:g} to {high:g}")
    return float(value)


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError("must be true or false")
    return value


def _choice(value: Any, choices: tuple[Any, ...]) -> Any:
    if isinstance(value, bool) or value not in choices:
        raise ValueError(f"must be one of {', '.join(map(str, choices))}")
    return value


def _window_size(value: Any) -> tuple[int, int]:
    if not isinstance(value, list) or len(value) != 2 or any(type(side) is not int for side in value):
        raise ValueError("must be two whole numbers")
    width, height = (
        int(_number(side, low, high)) for side, low, high in zip(value, SMALLEST_WINDOW, LARGEST_WINDOW, strict=True)
    )
    return width, height


def _keys(value: Any) -> dict[str, str]:
    if not isinstance(value, dict) or len(value) > MOST_KEYS:
        raise ValueError(f"must be an object of at most {MOST_KEYS} commands and their keys")
    if not all(isinstance(key, str) for key in value.values()):
        raise ValueError("must give each command a key as text, e.g. Ctrl+S")
    return value


def _titles(value: Any) -> tuple[str, ...]:
    if not isinstance(value, list) or len(value) > MOST_PANELS:
        raise ValueError(f"must be a list of at most {MOST_PANELS} titles of panels")
    if any(not isinstance(title, str) or len(title) > LONGEST_TITLE for title in value):
        raise ValueError(f"must be titles of at most {LONGEST_TITLE} characters")
    return tuple(dict.fromkeys(value))


_READERS: dict[str, Any] = {
    "show_panels": _flag,
    "camera_mode": lambda value: _choice(value, get_args(CameraMode)),
    "fov_degrees": lambda value: _number(value, *FOV_RANGE),
    "anisotropy": lambda value: _choice(value, ANISOTROPIES),
    "wipe_position": lambda value: _number(value, 0.0, 1.0),
    "window_size": _window_size,
    "coarse_while_moving": _flag,
    "tile_cache_megabytes": lambda value: int(_number(value, *TILE_CACHE_MEGABYTES)),
    "live_figures": _flag,
    "flicker_hz": lambda value: _number(value, *FLICKER_RANGE),
    "ui_scale": lambda value: _number(value, *UI_SCALE_RANGE),
    "keys": _keys,
    "theme": lambda value: _choice(value, get_args(Theme)),
    "hidden_panels": _titles,
}


def parse_settings(text: str, file: str) -> ViewerSettings:
    """Settings from JSON text; unknown fields are ignored, absent ones take their default. Raises InputError."""
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{file}: not JSON ({error}); it is replaced when the window closes") from error
    if not isinstance(content, dict):
        raise InputError(f"{file}: must be a JSON object; it is replaced when the window closes")
    fields: dict[str, Any] = {}
    for name, read in _READERS.items():
        if name in content:
            try:
                fields[name] = read(content[name])
            except (ValueError, TypeError) as error:
                raise InputError(f"{file}: {name} {error}; it is replaced when the window closes") from error
    return ViewerSettings(**fields)


def load_settings(folder: Path) -> tuple[ViewerSettings, str | None]:
    """The settings in `folder`, and what was wrong with them: a broken file gives the defaults and one line of text."""
    file = folder / SETTINGS_FILE
    try:
        if not file.exists():
            return ViewerSettings(), None
        return parse_settings(read_file(file, LARGEST_FILE).decode("utf-8"), str(file)), None
    except InputError as error:
        return ViewerSettings(), f"{error}; using defaults"
    except OSError as error:
        return ViewerSettings(), f"{file}: cannot be read ({error.strerror}); using defaults"
    except UnicodeDecodeError as error:
        return ViewerSettings(), f"{file}: cannot be read ({error}); using defaults"


def make_config_folder(folder: Path) -> None:
    """Make `folder` unless it is there. Raises InputError if it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made ({error}); set {CONFIG_FOLDER_VARIABLE}") from error


def save_settings(folder: Path, settings: ViewerSettings) -> None:
    """Write `settings` into `folder`, atomically. Raises InputError if it cannot be written."""
    make_config_folder(folder)
    write_text(folder / SETTINGS_FILE, json.dumps(asdict(settings), indent=2) + "\n")
