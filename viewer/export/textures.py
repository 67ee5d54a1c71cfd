"""Export of a scene with decoded images: `ntc-viewer export SCENE --pack F --out G.gltf --as FORMAT`."""

from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ntc.codec.latents import texture_levels
from ntc.codec.maps import SRGB_MAPS
from ntc.codec.mips import coded_z, mip_chain
from ntc.codec.model import Pack
from ntc.codec.quality import psnr_db
from ntc.codec.registry import codec_of
from ntc.pack.native import native_image
from viewer.export import ImageFormat
from viewer.export.gltf.document import GltfDocument, ImageFile
from viewer.export.gltf.export import OpenedExport, image_pixels, open_export, write_gltf
from viewer.export.gltf.options import PackedTextureOption, separate_entries
from viewer.export.images import Compressor, StoredFormat, stored_format
from viewer.scene.gltf.packed_textures import NO_CHANNEL
from viewer.scene.gltf.textures import IMAGE_EXTENSIONS
from viewer.scene.images import ProgressReport

Pixels = NDArray[np.uint8]
LevelDecoder = Callable[[int, int], Pixels]
"""Function: (texture of the pack, mip level) -> pixels [h, w, channels] uint8."""
OPAQUE = 255
CACHED_LEVELS = 16


def resized(pixels: Pixels, width: int, height: int) -> Pixels:
    """Return `pixels` [H, W, C] resized to [height, width, C] by averages over areas."""
    if pixels.shape[:2] == (height, width):
        return pixels
    channels = [
        Image.fromarray(pixels[..., k]).resize((width, height), Image.Resampling.BOX) for k in range(pixels.shape[2])
    ]
    return np.dstack([np.asarray(channel) for channel in channels])


@dataclass(frozen=True)
class DecodedImage:
    """Image of the scene whose channels are decoded where the pack has them, and taken from the original elsewhere."""

    pack: Pack
    option: PackedTextureOption
    original: Callable[[], Pixels | None]
    """Function that reads the original [H, W, 3 or 4]; it returns None where there is none."""

    @property
    def srgb(self) -> bool:
        """True where the image has colours in sRGB."""
        return bool(SRGB_MAPS.intersection(name for _, name in self.option.references))

    @property
    def is_normal(self) -> bool:
        """True where the image has normals, whose z is computed from x and y."""
        return any(name == "normal" for _, name in self.option.references)

    @property
    def components(self) -> list[int]:
        """Components of the image that the pack holds."""
        held = [k for k, channel in enumerate(self.option.channels) if channel != NO_CHANNEL]
        return [0, 1, 2] if self.is_normal else held

    def mips(self, decode: LevelDecoder, original: Pixels | None, all_levels: bool) -> list[Pixels]:
        """Return the largest mip of the pack [h, w, 3 or 4] and, with `all_levels`, all mips below it, down to 1x1.

        There are four channels where `original` has alpha. Mips below the pack's smallest one are averages of it.
        """
        layer = self.option.layer
        texture = self.pack.textures[layer]
        levels = texture_levels(texture, self.pack.config)
        largest_first = [
            self._composed(decode(layer, number), original) for number in range(len(levels) if all_levels else 1)
        ]
        return largest_first + self._smaller(largest_first[-1]) if all_levels else largest_first

    def _smaller(self, pixels: Pixels) -> list[Pixels]:
        """Return the mips below `pixels` [h, w, C], down to 1x1."""
        mips = list(mip_chain(pixels, "srgb" if self.srgb else "linear")[1:])
        if self.is_normal:
            for mip in mips:
                mip[..., 2:3] = coded_z(mip[..., :2])
        return mips

    def _composed(self, decoded: Pixels, original: Pixels | None) -> Pixels:
        height, width = decoded.shape[:2]
        channels = original.shape[2] if original is not None else 3
        whole = np.full((height, width, channels), OPAQUE, np.uint8)
        for component, channel in enumerate(self.option.channels[:channels]):
            if channel != NO_CHANNEL:
                whole[..., component] = decoded[..., channel]
            elif original is not None:
                whole[..., component] = resized(original[..., component : component + 1], width, height)[..., 0]
        if self.is_normal:
            whole[..., 2:3] = coded_z(whole[..., :2])
        return whole


def level_decoder(pack: Pack) -> LevelDecoder:
    """Return a decoder of the mips of `pack` on the CPU: libntc where it is built, torch elsewhere."""

    @cache
    def twin() -> LevelDecoder:
        # The import takes a second.
        return codec_of(pack.config).torch_twin(pack, "cpu").decode_image

    def decoded(texture: int, level: int) -> Pixels:
        image = native_image(pack, texture, level)
        return twin()(texture, level) if image is None else image

    # The cache serves a material set, which is decoded for each of its images.
    return lru_cache(CACHED_LEVELS)(decoded)


@dataclass(frozen=True)
class ImageLoss:
    """Losses of one image: PSNR in dB of 8-bit values, at the pack's size, over the components that the pack has.

    A PSNR is None where there is no original to compare with, and infinite where nothing changed.
    """

    name: str
    width: int
    height: int
    decoded_db: float | None
    """PSNR of the pack alone: decoded pixels against the original."""
    stored_db: float
    """PSNR of the format alone: written pixels against decoded ones."""
    both_db: float | None
    """PSNR of pack and format: written pixels against the original."""
    file_bytes: int


@dataclass(frozen=True)
class ExportedTextures:
    """Summary of an export with decoded images."""

    out: Path
    scene_bytes: int
    losses: tuple[ImageLoss, ...]
    kept: int
    """Number of images that stay as they are, because the pack lacks their textures."""
    missing: tuple[str, ...]


def _loss(one: Pixels, other: Pixels, components: list[int]) -> float:
    """Return the PSNR in dB over `components`."""
    return psnr_db(one[..., components], other[..., components])


class _Storing:
    """Encoder of images at the time they are written. It records their losses, and decodes the next image meanwhile."""

    def __init__(
        self, stored: StoredFormat, decode: LevelDecoder, pool: ThreadPoolExecutor, report: ProgressReport | None
    ) -> None:
        self._stored, self._decode, self._pool, self._report = stored, decode, pool, report
        self._images: list[DecodedImage] = []
        self._decoding: dict[int, Future[tuple[Pixels | None, list[Pixels]]]] = {}
        self.losses: list[ImageLoss] = []

    def file(self, image: DecodedImage, name: str) -> ImageFile:
        """Return the file of `image`, which is decoded and encoded when the file is written."""
        place = len(self._images)
        self._images.append(image)
        return ImageFile(f"{name}{self._stored.suffix}", self._stored.mime_type, lambda: self._made(place, name))

    def _decoded(self, image: DecodedImage) -> tuple[Pixels | None, list[Pixels]]:
        original = image.original()
        return original, image.mips(self._decode, original, self._stored.has_mips)

    def _made(self, place: int, name: str) -> bytes:
        image = self._images[place]
        for number in range(place, min(place + 2, len(self._images))):
            if number not in self._decoding:
                self._decoding[number] = self._pool.submit(self._decoded, self._images[number])
        original, mips = self._decoding.pop(place).result()
        stored = self._stored.store(mips, image.srgb)
        height, width = mips[0].shape[:2]
        if original is not None:
            original = resized(original, width, height)
        parts = image.components
        self.losses.append(
            ImageLoss(
                name,
                width,
                height,
                None if original is None else _loss(mips[0], original, parts),
                _loss(stored.read, mips[0], parts),
                None if original is None else _loss(stored.read, original, parts),
                len(stored.data),
            )
        )
        if self._report is not None:
            self._report.progress(len(self.losses), len(self._images))
        return stored.data


def export_textures(
    scene_path: Path,
    pack_path: Path,
    out: Path,
    image_format: ImageFormat,
    report: ProgressReport | None = None,
    compressor: Compressor | None = None,
) -> ExportedTextures:
    """Write the scene at `scene_path` to `out` with images in `image_format`, decoded from the pack at `pack_path`.

    `compressor` encodes BC7 blocks; None takes the encoder of the extra `lab`. Raises InputError, and what `report` raises; then
    nothing is written.
    """
    opened = open_export(scene_path, (pack_path,), out)
    (packed,) = opened.packs
    stored = stored_format(image_format, compressor)
    entries = separate_entries(opened.document, [packed.options])
    images = _distinct(opened, [(number, option) for number, (option,) in entries if option is not None])
    document = opened.document
    with ThreadPoolExecutor(1) as pool:
        storing = _Storing(stored, level_decoder(packed.pack), pool, report)
        first = len(document.entries("images"))
        for place, ((source, *_), (image, numbers)) in enumerate(images.items()):
            name = opened.file.label(opened.file.entries("images")[source], f"image {source}")
            index = first + place
            document.entries("images").append({"name": name})
            document.images[index] = storing.file(image, name.rsplit(".", 1)[0])
            for number in numbers:
                _name_image(document.entries("textures")[number], index, stored)
        if stored.extension:
            document.use_extension(stored.extension, required=True)
        document.remove_images(_unused(document))
        written = write_gltf(out, document)
    unchanged = len(document.entries("images")) - len(images)
    return ExportedTextures(out, written, tuple(storing.losses), unchanged, tuple(document.missing))


_Key = tuple[int, int, tuple[int, ...]]


def _distinct(
    opened: OpenedExport, entries: list[tuple[int, PackedTextureOption]]
) -> Mapping[_Key, tuple[DecodedImage, list[int]]]:
    """Return the images to write and the texture entries that show each, by (image of the file, texture of the pack, channels)."""
    images: dict[_Key, tuple[DecodedImage, list[int]]] = {}
    for number, option in entries:
        key = option.image, option.layer, tuple(option.channels)
        if key not in images:
            original = partial(image_pixels, opened.file, opened.buffers, option.image)
            images[key] = DecodedImage(opened.packs[0].pack, option, original), []
        images[key][1].append(number)
    return images


def _name_image(texture: dict[str, object], image: int, stored: StoredFormat) -> None:
    """Point a texture entry at image entry `image`, and at no other image."""
    extensions = texture.get("extensions")
    further = {k: v for k, v in extensions.items() if k not in IMAGE_EXTENSIONS} if isinstance(extensions, dict) else {}
    texture.pop("source", None)
    texture.pop("extensions", None)
    if stored.extension:
        further[stored.extension] = {"source": image}
    else:
        texture["source"] = image
    if further:
        texture["extensions"] = further


def _unused(document: GltfDocument) -> set[int]:
    """Return the image entries that no texture names."""
    used: set[int] = set()
    for texture in document.entries("textures"):
        for owner in (texture, *texture.get("extensions", {}).values()):
            if isinstance(owner.get("source"), int):
                used.add(owner["source"])
            used |= {option["source"] for option in owner.get("options", []) if isinstance(option.get("source"), int)}
    return set(range(len(document.entries("images")))) - used
