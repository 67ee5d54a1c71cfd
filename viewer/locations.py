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
    """Folder of settings and window layout: NTC_VIEWER_CONFIG_DIR, else the platform's folder for it."""
    return Path(os.environ.get(CONFIG_FOLDER_VARIABLE) or platformdirs.user_config_dir("ntc-viewer", appauthor=False))


def scene_roots() -> tuple[Path, ...]:
    """Folders that scenes may read from beside their own: NTC_VIEWER_SCENE_ROOTS, separated as in PATH."""
    given = os.environ.get(SCENE_ROOTS_VARIABLE, "")
    return tuple(Path(name).resolve() for name in given.split(os.pathsep) if name)


def cache_folder(name: Literal["blocks", "checks", "environments", "features", "images"]) -> Path:
    """Return the cache folder of compressed textures, measured values of `check`, prefiltered environments, features of textures or
    facts about images: in NTC_VIEWER_CACHE_DIR, else in the platform's folder for it."""
    given = os.environ.get(CACHE_FOLDER_VARIABLE) or platformdirs.user_cache_dir("ntc-viewer", appauthor=False)
    return Path(given, name)


def _data_folder(name: str) -> Path:
    given = os.environ.get(DATA_FOLDER_VARIABLE) or platformdirs.user_data_dir("ntc-viewer", appauthor=False)
    return Path(given, name)


def unsaved_runs_folder() -> Path:
    """Return the folder of autosaved runs: in NTC_VIEWER_DATA_DIR, else in the platform's data folder."""
    return _data_folder("runs")


def packs_folder(scene_path: Path) -> Path:
    """Return the folder of new packs of a scene: beside it; for a built-in scene in the user's data folder.

    An installation may be read-only, and belongs to all users of the machine.
    """
    return _data_folder("packs") if is_builtin(scene_path) else scene_path.parent


def _installed_folder(name: str) -> Path:
    # A checkout has it at its top level, an installed wheel inside the package.
    package = Path(__file__).resolve().parent
    for candidate in (package / "_resources" / name, package.parent / name):
        if candidate.is_dir():
            return candidate
    raise InputError(f"{package}: the folder {name}/ is missing from this installation; install ntc-viewer again")


def shaders_folder() -> Path:
    """Folder of the GLSL files."""
    return _installed_folder("shaders")


def assets_folder() -> Path:
    """Folder of the built-in scenes and the courtyard's packs."""
    return _installed_folder("assets")


def three_folder() -> Path:
    """Folder of the plug-in of three.js."""
    return _installed_folder("integrations/three")


def builtin_scene_path(name: str = BUILTIN_SCENES[0]) -> Path:
    """Path of a built-in scene: the one that is opened when none is named, or another of BUILTIN_SCENES."""
    return assets_folder() / f"{name}.glb"


def is_builtin(path: Path) -> bool:
    """Return whether `path` is one of the built-in scenes."""
    return path.resolve() in {builtin_scene_path(name).resolve() for name in BUILTIN_SCENES}


def named_scene(path: Path) -> Path:
    """Path of the scene that `path` names: a built-in one by its name where there is no such file."""
    return builtin_scene_path(str(path)) if str(path) in BUILTIN_SCENES and not path.exists() else path
