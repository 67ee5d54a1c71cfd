"""Where the program keeps files of the user."""

import os
from pathlib import Path

import platformdirs

CONFIG_FOLDER_VARIABLE = "NTC_VIEWER_CONFIG_DIR"
CACHE_FOLDER_VARIABLE = "NTC_VIEWER_CACHE_DIR"
SCENE_ROOTS_VARIABLE = "NTC_VIEWER_SCENE_ROOTS"


def config_folder() -> Path:
    """Where settings and window layout lie: NTC_VIEWER_CONFIG_DIR, else the platform's folder for it."""
    given = os.environ.get(CONFIG_FOLDER_VARIABLE)
    return Path(given) if given else Path(platformdirs.user_config_dir("ntc-viewer", appauthor=False))


def cache_folder() -> Path:
    """Where things lie that can be computed again: NTC_VIEWER_CACHE_DIR, else the platform's folder for it."""
    given = os.environ.get(CACHE_FOLDER_VARIABLE)
    return Path(given) if given else Path(platformdirs.user_cache_dir("ntc-viewer", appauthor=False))


def scene_roots() -> tuple[Path, ...]:
    """Folders that scenes may read from beside their own: NTC_VIEWER_SCENE_ROOTS, separated as in PATH."""
    given = os.environ.get(SCENE_ROOTS_VARIABLE, "")
    return tuple(Path(name).resolve() for name in given.split(os.pathsep) if name)


def features_cache() -> Path:
    """Where features of textures are kept, by pixel hash."""
    return cache_folder() / "features"
