"""`ntc-viewer export SCENE --pack F --out G.gltf --as FORMAT`: the scene with the images that its pack decodes to."""

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
"""(texture of the pack, level) -> [h, w, channels] uint8."""
OPAQUE = 255
LEVELS_KEPT = 16


def resized(pixels: Pixels, width: int, height: int) -> Pixels:
    """Return [height, width, C]: `pixels` [H, W, C] averaged over areas."""
    if pixels.shape[:2] == (height, width):
        return pixels
    channels = [
        Image.fromarray(pixels[..., k]).resize((width, height), Image.Resampling.BOX) for k in range(pixels.shape[2])
    ]
    return np.dstack([np.asarray(channel) for channel in channels])


@dataclass(frozen=True)
class DecodedImage:
    """An image of the scene: what the pack holds of it decoded, the rest from the original."""

    pack: Pack
    option: PackedTextureOption
    original: Callable[[], Pixels | None]
    """[H, W, 3 or 4]; None where there is none."""

    @property
    def srgb(self) -> bool:
        """True if it holds colours in sRGB."""
        return bool(SRGB_MAPS.intersection(name for _, name in self.option.references))

    @property
    def is_normal(self) -> bool:
        """True if it holds normals, whose z follows from x and y."""
        return any(name == "normal" for _, name in self.option.references)

    @property
    def components(self) -> list[int]:
        """Components of the image that the pack holds."""
        held = [k for k, channel in enumerate(self.option.channels) if channel != NO_CHANNEL]
        return [0, 1, 2] if self.is_normal else held

    def mips(self, decode: LevelDecoder, original: Pixels | None, all_levels: bool) -> list[Pixels]:
        """Return the largest level that the pack has, or the full pyramid below it: [h, w, 3], or 4 where `original` has alpha.

        Levels that the pack lacks are averaged from its smallest one.
        """
        layer = self.option.layer
        texture = self.pack.textures[layer]
        levels = texture_levels(texture, self.pack.config)
        found = [self._composed(decode(layer, number), original) for number in range(len(levels) if all_levels else 1)]
        return found + self._smaller(found[-1]) if all_levels else found

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
    """Decodes levels of `pack` on the processor: by libntc where it was built, else by torch."""

    @cache
    def twin() -> LevelDecoder:
        # It takes a second to import.
        return codec_of(pack.config).torch_twin(pack, "cpu").decode_image

    def decoded(texture: int, level: int) -> Pixels:
        image = native_image(pack, texture, level)
        return twin()(texture, level) if image is None else image

    # A material set is asked for once for each of its images.
    return lru_cache(LEVELS_KEPT)(decoded)


@dataclass(frozen=True)
class ImageLoss:
    """Losses of one image, over the components that the pack holds of it: PSNR in dB of 8-bit values at the size that the pack has;
    None where there is no original to compare with, infinite where nothing changed."""

    name: str
    width: int
    height: int
    decoded_db: float | None
    """PSNR of the pack alone: what was decoded against the original."""
    stored_db: float
    """PSNR of the format alone: what was written against what was decoded."""
    both_db: float | None
    """PSNR of what was written against the original."""
    file_bytes: int


@dataclass(frozen=True)
class ExportedTextures:
    """Summary of an export with decoded images."""

    out: Path
    scene_bytes: int
    losses: tuple[ImageLoss, ...]
    kept: int
    """Images of textures that the pack does not hold: they stay."""
    missing: tuple[str, ...]


def _loss(one: Pixels, other: Pixels, components: list[int]) -> float:
    """PSNR in dB over `components`."""
    return psnr_db(one[..., components], other[..., components])


class _Storing:
    """Makes images as they are written, and keeps what they lost. The next one is decoded meanwhile."""

    def __init__(
        self, stored: StoredFormat, decode: LevelDecoder, pool: ThreadPoolExecutor, report: ProgressReport | None
    ) -> None:
        self._stored, self._decode, self._pool, self._report = stored, decode, pool, report
        self._images: list[DecodedImage] = []
        self._decoding: dict[int, Future[tuple[Pixels | None, list[Pixels]]]] = {}
        self.losses: list[ImageLoss] = []

    def file(self, image: DecodedImage, name: str) -> ImageFile:
        """Return `image`, to be decoded and stored when it is written."""
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
    """Write the scene at `scene_path` to `out` with the images that the pack at `pack_path` decodes to, in `image_format`.

    `compressor` makes BC7 blocks; None: the encoder of the extra `lab`.
    Raises InputError, and what `report` raises; then no file is there that was not there before.
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
    kept = len(document.entries("images")) - len(images)
    return ExportedTextures(out, written, tuple(storing.losses), kept, tuple(document.missing))


_Key = tuple[int, int, tuple[int, ...]]


def _distinct(
    opened: OpenedExport, entries: list[tuple[int, PackedTextureOption]]
) -> Mapping[_Key, tuple[DecodedImage, list[int]]]:
    """Return the images to write with the texture entries that show them, by (image of the file, texture of the pack, channels)."""
    found: dict[_Key, tuple[DecodedImage, list[int]]] = {}
    for number, option in entries:
        key = option.image, option.layer, tuple(option.channels)
        if key not in found:
            original = partial(image_pixels, opened.file, opened.buffers, option.image)
            found[key] = DecodedImage(opened.packs[0].pack, option, original), []
        found[key][1].append(number)
    return found


def _name_image(texture: dict[str, object], image: int, stored: StoredFormat) -> None:
    """Let a texture entry show image entry `image` alone."""
    extensions = texture.get("extensions")
    kept = {k: v for k, v in extensions.items() if k not in IMAGE_EXTENSIONS} if isinstance(extensions, dict) else {}
    texture.pop("source", None)
    texture.pop("extensions", None)
    if stored.extension:
        kept[stored.extension] = {"source": image}
    else:
        texture["source"] = image
    if kept:
        texture["extensions"] = kept


def _unused(document: GltfDocument) -> set[int]:
    """Image entries that no texture names."""
    used: set[int] = set()
    for texture in document.entries("textures"):
        for owner in (texture, *texture.get("extensions", {}).values()):
            if isinstance(owner.get("source"), int):
                used.add(owner["source"])
            used |= {option["source"] for option in owner.get("options", []) if isinstance(option.get("source"), int)}
    return set(range(len(document.entries("images")))) - used
