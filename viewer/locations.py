"""Folders of the user's settings and caches, and of the shaders and assets of the installation."""

import os
from pathlib import Path
from typing import Literal

import platformdirs

from ntc.errors import InputError

CONFIG_FOLDER_VARIABLE = "NTC_VIEWER_CONFIG_DIR"
CACHE_FOLDER_VARIABLE = "NTC_VIEWER_CACHE_DIR"
DATA_FOLDER_VARIABLE = "NTC_VIEWER_DATA_DIR"
SCENE_ROOTS_VARIABLE = "NTC_VIEWER_SCENE_ROOTS"
BUILTIN_SCENES = ("courtyard", "gallery")


def config_folder() -> Path:
    """Return the folder of settings and window layout: NTC_VIEWER_CONFIG_DIR, else the platform's folder for settings."""
    return Path(os.environ.get(CONFIG_FOLDER_VARIABLE) or platformdirs.user_config_dir("ntc-viewer", appauthor=False))


def scene_roots() -> tuple[Path, ...]:
    """Return the folders in NTC_VIEWER_SCENE_ROOTS, separated as in PATH, that scenes may read files from besides their folder."""
    given = os.environ.get(SCENE_ROOTS_VARIABLE, "")
    return tuple(Path(name).resolve() for name in given.split(os.pathsep) if name)


def cache_folder(name: Literal["blocks", "checks", "environments", "features", "images"]) -> Path:
    """Return the cache folder of compressed textures, measured values of `check`, prefiltered environments, features of textures or
    facts of images: in NTC_VIEWER_CACHE_DIR, else in the platform's cache folder."""
    given = os.environ.get(CACHE_FOLDER_VARIABLE) or platformdirs.user_cache_dir("ntc-viewer", appauthor=False)
    return Path(given, name)


def _data_folder(name: str) -> Path:
    given = os.environ.get(DATA_FOLDER_VARIABLE) or platformdirs.user_data_dir("ntc-viewer", appauthor=False)
    return Path(given, name)


def unsaved_runs_folder() -> Path:
    """Return the folder of autosaved runs: in NTC_VIEWER_DATA_DIR, else in the platform's data folder."""
    return _data_folder("runs")


def packs_folder(scene_path: Path) -> Path:
    """Return the folder of new packs of a scene: the scene's folder; for a built-in scene one in the user's data folder.

    The installation may be read-only, and all users of the machine share it.
    """
    return _data_folder("packs") if is_builtin(scene_path) else scene_path.parent


def _installed_folder(name: str) -> Path:
    # The folder lies at the top level of a checkout, and inside the package of an installed wheel.
    package = Path(__file__).resolve().parent
    for candidate in (package / "_resources" / name, package.parent / name):
        if candidate.is_dir():
            return candidate
    raise InputError(f"{package}: the folder {name}/ is missing from this installation; install ntc-viewer again")


def shaders_folder() -> Path:
    """Return the folder of the GLSL files."""
    return _installed_folder("shaders")


def assets_folder() -> Path:
    """Return the folder of the built-in scenes and the courtyard's packs."""
    return _installed_folder("assets")


def three_folder() -> Path:
    """Return the folder of the three.js plug-in."""
    return _installed_folder("integrations/three")


def builtin_scene_path(name: str = BUILTIN_SCENES[0]) -> Path:
    """Return the path of a built-in scene: the one that opens by default, or another of BUILTIN_SCENES."""
    return assets_folder() / f"{name}.glb"


def is_builtin(path: Path) -> bool:
    """Return whether `path` is one of the built-in scenes."""
    return path.resolve() in {builtin_scene_path(name).resolve() for name in BUILTIN_SCENES}


def named_scene(path: Path) -> Path:
    """Return the path of the scene that `path` names: a built-in scene by its name unless there is such a file."""
    return builtin_scene_path(str(path)) if str(path) in BUILTIN_SCENES and not path.exists() else path
