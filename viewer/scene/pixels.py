"""Caches of images: pixels in memory, facts on disk. The key of facts is the hash of an image's file, so a scene opens again
without decoding its images."""

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
"""Version of cached facts. Raise it when decoding or splitting of images changes."""


class MapFacts(msgspec.Struct, frozen=True):
    """Facts of a map in an image."""

    key: str = ""
    """Identity of the pixels (`hash_pixels`); "" for a map that is constant or not usable."""
    constant: tuple[int, ...] | None = None
    """Value of all texels, 0 to 255, of a constant map."""
    remark: str = ""
    """Fault of the map, for the load report."""


class ImageFacts(msgspec.Struct, frozen=True):
    """Facts of an image, of the maps that materials read."""

    size: tuple[int, int]
    """(width, height) in texels."""
    decoded_bytes: int
    kept_bytes: int
    """Bytes of the pixels that materials read."""
    pixel_hash: str = ""
    """Identity of the base colour, with alpha if that is read; "" where it is constant or not read."""
    has_alpha: bool = False
    constant: tuple[float, float, float, float] | None = None
    """Linear RGBA of a constant base colour."""
    maps: dict[MapName, MapFacts] = {}


class _Content(msgspec.Struct):
    images: dict[str, ImageFacts]
    sets: dict[str, str]


class FactsFile:
    """Cache on disk of the facts of a scene's images and the hashes of its material sets. Threads may add to it."""

    def __init__(self, folder: Path | None, scene: Path | None) -> None:
        """Open the facts of the file `scene` in the cache `folder`. With either None, nothing is cached."""
        self._cache = ContentCache(folder if scene is not None else None)
        self._key = f"{VERSION} {OpenImageIO.__version__} {scene.resolve()}" if scene is not None else ""
        self._known = self._cache.read_value(self._key, _Content) or _Content({}, {})
        self._used = _Content({}, {})
        self._new_bytes = 0

    @staticmethod
    def image_key(data: bytes, use: str) -> str:
        """Return the key of the facts of an image file; `use` names the maps that are read of it."""
        return f"{hashlib.sha256(data).hexdigest()[:32]} {use}"

    def image(self, key: str) -> ImageFacts | None:
        """Return the cached facts of the image with this key; None for unknown ones."""
        facts = self._known.images.get(key)
        if facts is not None:
            self._used.images[key] = facts
        return facts

    def add_image(self, key: str, facts: ImageFacts) -> None:
        """Add the facts of an image that was decoded."""
        self._used.images[key] = facts
        self._new_bytes += facts.decoded_bytes

    def set_hash(self, key: str) -> str | None:
        """Return the cached hash of the material set whose maps `key` identifies; None for an unknown one."""
        digest = self._known.sets.get(key)
        if digest is not None:
            self._used.sets[key] = digest
        return digest

    def add_set(self, key: str, digest: str) -> None:
        """Add the hash of a material set."""
        self._used.sets[key] = digest

    def write(self, least_bytes: int) -> None:
        """Write the facts that were used, if images of at least `least_bytes` were decoded; skipped where the folder is read-only."""
        if self._new_bytes >= max(least_bytes, 1):
            self._cache.write_value(self._key, self._used)


LARGEST_CACHE = 1 << 29
"""Most bytes of cached pixels of one scene."""


class Sized(Protocol):
    """Object with a known size in memory."""

    @property
    def nbytes(self) -> int:
        """Bytes of memory."""
        ...


Content = TypeVar("Content", bound=Sized)


class PixelCache:
    """Cache in memory, by key, that drops the least recently used content first. Of threads that ask for a new key at the same time,
    one makes the content and the others wait for it."""

    def __init__(self, most_bytes: int = LARGEST_CACHE) -> None:
        self._lock = threading.Lock()
        self._most_bytes = most_bytes
        self._contents: OrderedDict[Hashable, Sized] = OrderedDict()
        self._being_made: dict[Hashable, threading.Event] = {}
        self._bytes = 0
        self.made = 0
        """Number of cache misses so far."""

    @property
    def nbytes(self) -> int:
        """Bytes of the cached content, at most `most_bytes`."""
        return self._bytes

    def offer(self, key: Hashable, content: Sized) -> None:
        """Cache `content` if it fits without dropping anything."""
        with self._lock:
            if key not in self._contents and self._bytes + content.nbytes <= self._most_bytes:
                self._add(key, content)

    def get(self, key: Hashable, make: Callable[[], Content]) -> Content:
        """Return the content cached under `key`, else the result of `make`, which is cached. Exceptions of `make` are not cached."""
        while True:
            with self._lock:
                if key in self._contents:
                    self._contents.move_to_end(key)
                    return cast(Content, self._contents[key])
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
                    self._add(key, content)
            return content
        finally:
            with self._lock:
                del self._being_made[key]
            mine.set()

    def _add(self, key: Hashable, content: Sized) -> None:
        self._contents[key] = content
        self._bytes += content.nbytes
        while self._bytes > self._most_bytes:
            _, oldest = self._contents.popitem(last=False)
            self._bytes -= oldest.nbytes


@dataclass(frozen=True, eq=False)
class ImageContent:
    """Pixels of an image, split into the maps that materials read."""

    pixels: NDArray[np.uint8] | None = None
    """[H, W, 3] base colour; None where no material reads it, or it is constant."""
    alpha: NDArray[np.uint8] | None = None
    maps: Mapping[MapName, NDArray[np.uint8]] = field(default_factory=dict)
    """[H, W, channels] of each map that is not constant."""

    @property
    def nbytes(self) -> int:
        """Bytes of memory."""
        return sum(part.nbytes for part in (self.pixels, self.alpha, *self.maps.values()) if part is not None)


class TexturePixels(Protocol):
    """Source of a texture's pixels, which may read files. Any thread may call it. All methods raise InputError."""

    def picture(self) -> NDArray[np.uint8]:
        """Return [H, W, 3] uint8 sRGB: the base colour; of a set without one a picture of its first map."""
        ...

    def alpha(self) -> NDArray[np.uint8] | None:
        """Return [H, W] uint8 coverage; None where there is none."""
        ...

    def further(self) -> Mapping[MapName, NDArray[np.uint8]]:
        """Return [H, W, channels of the map] uint8 of each map besides the base colour."""
        ...


@dataclass(frozen=True, eq=False)
class PixelsInMemory:
    """Pixels of a texture that stay in memory."""

    color: NDArray[np.uint8]
    """[H, W, 3] sRGB."""
    coverage: NDArray[np.uint8] | None = None
    """[H, W] alpha."""
    maps: Mapping[MapName, NDArray[np.uint8]] = field(default_factory=dict)

    def picture(self) -> NDArray[np.uint8]:
        """Return [H, W, 3] uint8."""
        return self.color

    def alpha(self) -> NDArray[np.uint8] | None:
        """Return [H, W] uint8."""
        return self.coverage

    def further(self) -> Mapping[MapName, NDArray[np.uint8]]:
        """Return the maps besides the base colour, each [H, W, C] uint8."""
        return self.maps
