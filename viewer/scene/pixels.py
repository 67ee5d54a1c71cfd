"""Pixels of images and their facts: pixels are kept in memory, facts on disk by the bytes of their files, so that a scene opens
without decoding again."""

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Protocol, TypeVar, cast

import msgspec
import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from ntc.codec.maps import MapName
from ntc.content_cache import ContentCache

VERSION: Final = 1
"""Changes with how images are decoded and taken apart."""


class MapFacts(msgspec.Struct, frozen=True):
    """Facts of a map as one image holds it."""

    key: str = ""
    """Identity of its pixels (`hash_pixels`); "" when there is nothing to sample: it is constant, or not usable."""
    constant: tuple[int, ...] | None = None
    """The only value, 0 to 255, where there is but one."""
    remark: str = ""
    """Fault of the map that the load report names."""


class ImageFacts(msgspec.Struct, frozen=True):
    """Facts of an image, for the parts that materials read."""

    size: tuple[int, int]
    """(width, height) in texels."""
    decoded_bytes: int
    kept_bytes: int
    """Bytes of the pixels that materials read."""
    pixel_hash: str = ""
    """Identity of the base colour, with alpha where that is read; "" where it is constant or not read."""
    has_alpha: bool = False
    constant: tuple[float, float, float, float] | None = None
    """Linear RGBA where all texels of the base colour are equal."""
    maps: dict[MapName, MapFacts] = {}


class _Content(msgspec.Struct):
    images: dict[str, ImageFacts]
    sets: dict[str, str]


class FactsFile:
    """Facts of a scene's images, and hashes of its material sets. Threads may add to it."""

    def __init__(self, folder: Path | None, scene: Path | None) -> None:
        """Keep facts in the cache `folder`; without it, or a scene's file, nothing is kept."""
        self._cache = ContentCache(folder if scene is not None else None)
        self._key = f"{VERSION} {OpenImageIO.__version__} {scene.resolve()}" if scene is not None else ""
        self._known = self._cache.read_value(self._key, _Content) or _Content({}, {})
        self._used = _Content({}, {})
        self._new_bytes = 0

    @staticmethod
    def image_key(data: bytes, use: str) -> str:
        """Return the key of the facts of an image file; `use` says what is read of it."""
        return f"{hashlib.sha256(data).hexdigest()[:32]} {use}"

    def image(self, key: str) -> ImageFacts | None:
        """Return what is known under `key`."""
        found = self._known.images.get(key)
        if found is not None:
            self._used.images[key] = found
        return found

    def add_image(self, key: str, facts: ImageFacts) -> None:
        """Remember what was found out."""
        self._used.images[key] = facts
        self._new_bytes += facts.decoded_bytes

    def set_hash(self, key: str) -> str | None:
        """Return the hash of the set whose parts `key` identifies."""
        found = self._known.sets.get(key)
        if found is not None:
            self._used.sets[key] = found
        return found

    def add_set(self, key: str, digest: str) -> None:
        """Remember a set's hash."""
        self._used.sets[key] = digest

    def write(self, least_bytes: int) -> None:
        """Keep what is used of it, if images of so many bytes were decoded for it; nothing where the folder cannot be written."""
        if self._new_bytes >= max(least_bytes, 1):
            self._cache.write_value(self._key, self._used)


LARGEST_CACHE = 1 << 29
"""Bytes of one scene."""


class Sized(Protocol):
    """Object that takes memory."""

    @property
    def nbytes(self) -> int:
        """Bytes of memory."""
        ...


Content = TypeVar("Content", bound=Sized)


class PixelCache:
    """Content by key. Any thread may ask; what several ask for at once is made once."""

    def __init__(self, most_bytes: int = LARGEST_CACHE) -> None:
        self._lock = threading.Lock()
        self._most_bytes = most_bytes
        self._kept: OrderedDict[Hashable, Sized] = OrderedDict()
        self._being_made: dict[Hashable, threading.Event] = {}
        self._bytes = 0
        self.made = 0
        """Number of times that something was made because it was not there."""

    @property
    def nbytes(self) -> int:
        """Bytes of what is kept: never more than allowed."""
        return self._bytes

    def offer(self, key: Hashable, content: Sized) -> None:
        """Keep `content` if there is room for it without removing anything."""
        with self._lock:
            if key not in self._kept and self._bytes + content.nbytes <= self._most_bytes:
                self._keep(key, content)

    def get(self, key: Hashable, make: Callable[[], Content]) -> Content:
        """Return what is kept under `key`, which always means the same, else what `make` returns. What it raises is not kept."""
        while True:
            with self._lock:
                if key in self._kept:
                    self._kept.move_to_end(key)
                    return cast(Content, self._kept[key])
                waits_for = self._being_made.get(key)
                if waits_for is None:
                    mine = self._being_made[key] = threading.Event()
                    break
            waits_for.wait()
        try:
            content = make()
            with self._lock:
                self.made += 1
                if content.nbytes <= self._most_bytes:
                    self._keep(key, content)
            return content
        finally:
            with self._lock:
                del self._being_made[key]
            mine.set()

    def _keep(self, key: Hashable, content: Sized) -> None:
        self._kept[key] = content
        self._bytes += content.nbytes
        while self._bytes > self._most_bytes:
            _, oldest = self._kept.popitem(last=False)
            self._bytes -= oldest.nbytes


@dataclass(frozen=True, eq=False)
class ImageContent:
    """The pixels of an image that materials read."""

    pixels: NDArray[np.uint8] | None = None
    """[H, W, 3] where a material reads it as base colour and it is not constant."""
    alpha: NDArray[np.uint8] | None = None
    maps: Mapping[MapName, NDArray[np.uint8]] = field(default_factory=dict)
    """[H, W, channels] of those that are not constant."""

    @property
    def nbytes(self) -> int:
        """Bytes of memory."""
        return sum(part.nbytes for part in (self.pixels, self.alpha, *self.maps.values()) if part is not None)


class TexturePixels(Protocol):
    """Pixels of one texture, that may have to be read from a file: any thread may ask. All raise InputError where that fails."""

    def picture(self) -> NDArray[np.uint8]:
        """Return [H, W, 3] uint8 sRGB: base colour; of a set without one a picture of its first map."""
        ...

    def alpha(self) -> NDArray[np.uint8] | None:
        """Return [H, W] uint8 coverage; None where there is none."""
        ...

    def further(self) -> Mapping[MapName, NDArray[np.uint8]]:
        """Return [H, W, channels of the map] uint8 of each map besides the base colour."""
        ...


@dataclass(frozen=True, eq=False)
class PixelsInMemory:
    """Pixels that are there as long as the texture."""

    color: NDArray[np.uint8]
    """[H, W, 3]."""
    coverage: NDArray[np.uint8] | None = None
    """[H, W]."""
    maps: Mapping[MapName, NDArray[np.uint8]] = field(default_factory=dict)

    def picture(self) -> NDArray[np.uint8]:
        """Return [H, W, 3] uint8."""
        return self.color

    def alpha(self) -> NDArray[np.uint8] | None:
        """Return [H, W] uint8."""
        return self.coverage

    def further(self) -> Mapping[MapName, NDArray[np.uint8]]:
        """Maps besides the base colour, each [H, W, C] uint8."""
        return self.maps
