"""Measured values of textures: each is decoded and compared with its original, unless its values are cached."""

import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ntc.api import decode
from ntc.codec.maps import MapName
from ntc.codec.model import EncodedTexture, Pack
from ntc.codec.quality import finite_or_none, measured_texture
from ntc.codec.registry import codec_of
from ntc.codec.textures import SourceTexture
from ntc.content_cache import ContentCache
from ntc.errors import InputError
from ntc.features.pixels import as_rgb
from ntc.pack.match import PackMatch
from ntc.pack.schema import codec_json
from viewer.checking.record import MapRecord, TextureRecord
from viewer.scene.images import ProgressReport, map_in_threads
from viewer.scene.model import Scene
from viewer.scene.source_textures import MapChoice, reduce_texture, source_texture, without_alpha

DIGITS = 40
THUMBNAIL = 72
"""Pixels a side of a picture in a strip."""
AMPLIFICATION = 8
"""Factor of the difference in a strip."""
STRIP_QUALITY = 80


class CachedTexture(msgspec.Struct, frozen=True):
    """Cached values of a measured texture."""

    maps: dict[MapName, MapRecord]
    strip: bytes
    """JPEG: original, decoded and their difference side by side, for the page."""


@dataclass(frozen=True, eq=False)
class MeasuredTextures:
    """Records of the textures of a pack."""

    records: tuple[TextureRecord, ...]
    strips: Mapping[str, bytes]
    """JPEG strips by content; empty where a pack was read without its scene."""
    measured: int
    """Number of textures that were decoded; the values of the others were cached."""


def recorded_textures(pack: Pack) -> MeasuredTextures:
    """Return the textures of `pack` with the quality that its encoder recorded, because there is no scene to compare with."""
    digests = _decoder_digests(pack)
    records = tuple(
        _record(pack, texture, _content(pack, index, digests), _recorded_maps(texture))
        for index, texture in enumerate(pack.textures)
    )
    return MeasuredTextures(records, {}, 0)


def measured_textures(
    scene: Scene, pack: Pack, match: PackMatch, cache: ContentCache, report: ProgressReport | None = None
) -> MeasuredTextures:
    """Return the measured textures of `scene` that `pack` holds, in the order of the scene.

    Raises InputError where an original has changed since it was encoded.
    """
    digests = _decoder_digests(pack)
    materials = _materials(scene)
    chosen = [(texture_id, index) for texture_id, index in enumerate(match.texture_index) if index >= 0]

    def measure(item: tuple[int, int]) -> tuple[TextureRecord, bytes, bool]:
        texture_id, index = item
        content = _content(pack, index, digests)
        cached = cache.read_value(content, CachedTexture)
        if cached is None:
            values = _measure(scene, pack, texture_id, index)
            cache.write_value(content, values)
        else:
            values = cached
        record = _record(pack, pack.textures[index], content, values.maps, materials.get(texture_id, ()))
        return record, values.strip, cached is None

    results = map_in_threads(measure, chosen, report)
    strips = {record.content: strip for record, strip, _ in results}
    return MeasuredTextures(tuple(record for record, _, _ in results), strips, sum(now for _, _, now in results))


def original_of(scene: Scene, texture_id: int, encoded: EncodedTexture) -> SourceTexture:
    """Return the original of an encoded texture at the size that was encoded. Raises InputError where it has another shape."""
    maps: MapChoice = (
        "base" if encoded.pixel_hash == scene.textures[texture_id].pixel_hash and len(encoded.maps) == 1 else "all"
    )
    whole = source_texture(scene, texture_id, None, maps)
    source = reduce_texture(
        whole if "alpha" in encoded.maps else without_alpha(whole), max(encoded.width, encoded.height)
    )
    if source.pixels.shape != (encoded.height, encoded.width, encoded.channels):
        raise InputError(
            f"{encoded.name}: the pack has {encoded.width} x {encoded.height} texels of {encoded.channels} channels, the scene "
            f"{source.size[0]} x {source.size[1]} of {source.channels}; encode it again"
        )
    return source


def _measure(scene: Scene, pack: Pack, texture_id: int, index: int) -> CachedTexture:
    encoded = pack.textures[index]
    pixels = original_of(scene, texture_id, encoded).pixels
    decoded = decode(pack, index)
    return CachedTexture(_recorded_maps(measured_texture(encoded, decoded, pixels)), _strip(pixels, decoded))


def _recorded_maps(texture: EncodedTexture) -> dict[MapName, MapRecord]:
    if not texture.map_psnr_db:
        # The maps of this material set were only measured together. The value is listed under the first map.
        return {texture.maps[0]: MapRecord(finite_or_none(texture.psnr_db))}
    degrees = texture.normal_degrees[0] if texture.normal_degrees is not None else None
    return {
        name: MapRecord(finite_or_none(psnr), degrees if name == "normal" else None)
        for name, psnr in zip(texture.maps, texture.map_psnr_db, strict=True)
    }


def _record(
    pack: Pack, texture: EncodedTexture, content: str, maps: dict[MapName, MapRecord], materials: tuple[str, ...] = ()
) -> TextureRecord:
    sizes = codec_of(pack.config).texture_bytes(texture, pack.config)
    stored = sizes.latents + sizes.constants + sizes.adapter
    return TextureRecord(
        name=texture.name,
        content=content,
        pixel_hash=texture.pixel_hash,
        width=texture.width,
        height=texture.height,
        bytes=stored,
        bits_per_texel=8.0 * stored / (texture.width * texture.height),
        maps=maps,
        materials=materials,
        pack=str(pack.path or ""),
    )


def _materials(scene: Scene) -> dict[int, tuple[str, ...]]:
    """Return the names of the materials that use each texture, by texture id."""
    names: dict[int, dict[str, None]] = {}
    for material in scene.materials:
        for plane in ("base", "surface", "emission"):
            names.setdefault(material.plane_texture(plane), {})[material.name] = None
    return {texture_id: tuple(names_of_texture) for texture_id, names_of_texture in names.items()}


def _digest(arrays: Mapping[str, NDArray[np.generic]], *facts: str) -> str:
    digest = hashlib.sha256("\0".join(facts).encode("utf-8", "replace"))
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype} {array.shape}".encode())
        digest.update(array.data)
    return digest.hexdigest()[:DIGITS]


def _decoder_digests(pack: Pack) -> Sequence[str]:
    codec = codec_of(pack.config)
    settings = msgspec.json.encode(codec_json(pack.config), order="deterministic").decode()
    return [_digest(codec.decoder_tensors(decoder, pack.config), settings) for decoder in pack.decoders]


def _content(pack: Pack, index: int, digests: Sequence[str]) -> str:
    texture = pack.textures[index]
    tensors = codec_of(pack.config).texture_tensors(texture, pack.config)
    return _digest(tensors, texture.pixel_hash, f"{texture.width}x{texture.height}", digests[texture.group])


def _strip(pixels: NDArray[np.uint8], decoded: NDArray[np.uint8]) -> bytes:
    """Return a JPEG with the original, the decoded texture and their amplified difference, each of THUMBNAIL pixels a side."""
    first, second = as_rgb(pixels[..., :3]), as_rgb(decoded[..., :3])
    difference = np.abs(first.astype(np.int16) - second.astype(np.int16)) * AMPLIFICATION
    parts = (first, second, np.minimum(difference, 255).astype(np.uint8))
    strip = Image.new("RGB", (3 * THUMBNAIL, THUMBNAIL))
    for number, part in enumerate(parts):
        shown = Image.fromarray(np.ascontiguousarray(part)).resize((THUMBNAIL, THUMBNAIL), Image.Resampling.BOX)
        strip.paste(shown, (number * THUMBNAIL, 0))
    data = io.BytesIO()
    strip.save(data, "JPEG", quality=STRIP_QUALITY)
    return data.getvalue()
