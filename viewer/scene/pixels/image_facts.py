"""What is known of images without their pixels, kept on disk by the bytes of their files: a scene opens without decoding again."""

import hashlib
from contextlib import suppress
from pathlib import Path
from typing import Final

import msgspec
import OpenImageIO

from ntc.codec.maps import MapName
from ntc.errors import InputError
from ntc.io import is_partial, read_file, write_bytes

VERSION: Final = 1
"""Changes with how images are decoded and taken apart."""
LARGEST_FILE: Final = 1 << 28
MOST_SCENES: Final = 64
"""Scenes of which facts are kept: those opened longest ago are forgotten first."""
SUFFIX: Final = ".facts"


class MapFacts(msgspec.Struct, frozen=True):
    """One map as one image holds it."""

    key: str = ""
    """Identity of its pixels (`hash_pixels`); "" when there is nothing to sample: it is constant, or not usable."""
    constant: tuple[int, ...] | None = None
    """The only value, 0 to 255, where there is but one."""
    remark: str = ""
    """What was wrong with it."""


class ImageFacts(msgspec.Struct, frozen=True):
    """One image, for what materials read of it."""

    size: tuple[int, int]
    """(width, height) in texels."""
    decoded_bytes: int
    kept_bytes: int
    """Of the pixels that materials read."""
    pixel_hash: str = ""
    """Identity of the base colour, with alpha where that is read; "" where it is constant or not read."""
    has_alpha: bool = False
    constant: tuple[float, float, float, float] | None = None
    """Linear RGBA where all texels of the base colour are equal."""
    maps: dict[MapName, MapFacts] = {}


class _Content(msgspec.Struct):
    version: str
    images: dict[str, ImageFacts]
    sets: dict[str, str]


class FactsFile:
    """Facts of a scene's images, and hashes of its material sets. Threads may add to it."""

    def __init__(self, folder: Path | None, scene: Path | None) -> None:
        """`folder` is the cache's; without it, or a scene's file, nothing is kept."""
        self._path: Path | None = None
        if folder is not None and scene is not None:
            name = hashlib.sha256(str(scene.resolve()).encode(errors="surrogateescape")).hexdigest()[:32]
            self._path = folder / f"{name}{SUFFIX}"
        self._version = f"{VERSION} {OpenImageIO.__version__}"
        self._known = self._read()
        self._used = _Content(self._version, {}, {})
        self._new_bytes = 0

    def _read(self) -> _Content:
        with suppress(OSError, msgspec.MsgspecError, UnicodeDecodeError):
            if self._path is not None:
                content = msgspec.json.decode(read_file(self._path, LARGEST_FILE), type=_Content)
                if content.version == self._version:
                    return content
        return _Content(self._version, {}, {})

    @staticmethod
    def image_key(data: bytes, use: str) -> str:
        """Under which facts of an image file are kept; `use` says what is read of it."""
        return f"{hashlib.sha256(data).hexdigest()[:32]} {use}"

    def image(self, key: str) -> ImageFacts | None:
        """What is known under `key`."""
        found = self._known.images.get(key)
        if found is not None:
            self._used.images[key] = found
        return found

    def add_image(self, key: str, facts: ImageFacts) -> None:
        """Remember what was found out."""
        self._used.images[key] = facts
        self._new_bytes += facts.decoded_bytes

    def set_hash(self, key: str) -> str | None:
        """The hash of the set whose parts `key` identifies."""
        found = self._known.sets.get(key)
        if found is not None:
            self._used.sets[key] = found
        return found

    def add_set(self, key: str, digest: str) -> None:
        """Remember a set's hash."""
        self._used.sets[key] = digest

    def write(self, least_bytes: int) -> None:
        """Keep what is used of it, if images of so many bytes were decoded for it; nothing where the folder cannot be written."""
        if self._path is None or self._new_bytes < max(least_bytes, 1):
            return
        with suppress(InputError, OSError):
            write_bytes(self._path, msgspec.json.encode(self._used))
            _trim(self._path.parent)


def _trim(folder: Path) -> None:
    files = [path for path in folder.glob(f"*{SUFFIX}") if path.is_file() and not is_partial(path)]
    for path in sorted(files, key=lambda path: path.stat().st_mtime_ns)[:-MOST_SCENES]:
        path.unlink()
