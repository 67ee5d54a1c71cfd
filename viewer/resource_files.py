"""Where shaders and assets lie: in a checkout at its top level, in an installed wheel inside the package."""

from pathlib import Path

from ntc.errors import InputError


def _folder(name: str) -> Path:
    package = Path(__file__).resolve().parent
    for candidate in (package / "_resources" / name, package.parent / name):
        if candidate.is_dir():
            return candidate
    raise InputError(f"{package}: the folder {name}/ is missing from this installation; install ntc-viewer again")


def shaders_folder() -> Path:
    """Folder of the GLSL files."""
    return _folder("shaders")


def assets_folder() -> Path:
    """Folder of the built-in scene and its packs."""
    return _folder("assets")
