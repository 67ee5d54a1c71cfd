"""Table of the scene's textures with the figures of a pack."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

from ntc.codec.maps import MAPS, MapName
from ntc.codec.model import EncodedTexture, Pack
from ntc.codec.registry import codec_of
from ntc.metrics.compressed_textures import CompressedTextures
from ntc.pack.match import PackMatch
from viewer.inspect.comparison import ErrorRow
from viewer.scene.model import Scene

TextureColumn = Literal[
    "name",
    "size",
    "category",
    "group",
    "mip 0 dB",
    "bits",
    "kB",
    "normals",
    "error %",
    "base dB",
    "normal dB",
    "roughness dB",
    "metalness dB",
    "emissive dB",
    "occlusion dB",
    "on GPU",
]
COLUMNS: tuple[TextureColumn, ...] = get_args(TextureColumn)


@dataclass(frozen=True)
class TextureRow:
    """Row of the table: a texture of the scene."""

    texture_id: int
    name: str
    width: int
    height: int
    category: str
    """"" for none."""
    group: int
    """Decoder in the pack; -1 where nothing is decoded."""
    psnr_db: float | None
    """PSNR of mip 0 in dB, measured by the encoder."""
    bits_per_texel: float | None
    """Bits of the latents of all mips, per texel of the encoded mip 0."""
    file_bytes: int | None = None
    """Bytes of the latents in the file; in a block format, bytes of the blocks."""
    map_psnr_db: Mapping[MapName, float] = field(default_factory=dict)
    """PSNR of mip 0 in dB of each map of a material set."""
    normal_degrees: float | None = None
    """Mean angle in degrees between decoded and original normals of a material set."""
    error_share: float | None = None
    """Share of the squared error of the picture, 0 to 1; None where the texture is not in it."""
    gpu_bytes: int | None = None
    """Bytes of the latents on the GPU, None before the pack is drawn; in a block format, bytes of the blocks."""

    def key(self, column: TextureColumn) -> tuple[int, float | str]:
        """Return the key to sort rows by a column; unknown values come last in ascending order."""
        values: dict[str, float | str | None] = {
            "name": self.name.casefold(),
            "size": self.width * self.height,
            "category": self.category.casefold() or None,
            "group": self.group if self.group >= 0 else None,
            "mip 0 dB": self.psnr_db,
            "bits": self.bits_per_texel,
            "kB": self.file_bytes,
            "normals": self.normal_degrees,
            "error %": self.error_share,
            **{f"{name} dB": self.map_psnr_db.get(name) for name in MAPS},
            "on GPU": self.gpu_bytes,
        }
        value = values[column]
        return (1, 0.0) if value is None else (0, value)


def texture_rows(
    scene: Scene, pack: Pack | None, match: PackMatch | None, gpu_bytes: Sequence[int] | None
) -> tuple[TextureRow, ...]:
    """Return the rows of all textures by id; `gpu_bytes` has the bytes of their latents on the GPU, by texture id."""
    rows: list[TextureRow] = []
    for number, texture in enumerate(scene.textures):
        width, height = texture.size
        index = match.texture_index[number] if match is not None else -1
        encoded = pack.textures[index] if pack is not None and index >= 0 else None
        stored = bits = None
        if encoded is not None and pack is not None:
            stored = codec_of(pack.config).texture_bytes(encoded, pack.config).latents
            bits = 8.0 * stored / (encoded.width * encoded.height)
        psnr = encoded.psnr_db if encoded is not None else None
        rows.append(
            TextureRow(
                texture_id=number,
                name=texture.name,
                width=width,
                height=height,
                category=texture.category or (encoded.category if encoded is not None else None) or "",
                group=encoded.group if encoded is not None else -1,
                psnr_db=psnr if psnr is None or not math.isnan(psnr) else None,
                bits_per_texel=bits,
                file_bytes=stored,
                map_psnr_db=_by_map(encoded) if encoded is not None else {},
                normal_degrees=encoded.normal_degrees[0] if encoded is not None and encoded.normal_degrees else None,
                gpu_bytes=gpu_bytes[number] if gpu_bytes is not None and encoded is not None else None,
            )
        )
    return tuple(rows)


def _by_map(encoded: EncodedTexture) -> dict[MapName, float]:
    return {
        name: value
        for name, value in zip(encoded.maps, encoded.map_psnr_db, strict=False)
        if value is not None and not math.isnan(value)
    }


def with_error_shares(rows: Iterable[TextureRow], errors: Sequence[ErrorRow]) -> tuple[TextureRow, ...]:
    """Return rows with each texture's share of the squared error of a picture, of which `errors` are the errors by texture."""
    squares = {error.number: error.rmse**2 * error.pixels for error in errors}
    total = sum(squares.values()) or 1.0
    return tuple(
        replace(row, error_share=squares[row.texture_id] / total) if row.texture_id in squares else row for row in rows
    )


def compressed_rows(scene: Scene, compressed: CompressedTextures) -> tuple[TextureRow, ...]:
    """Return the rows of all textures by id in a block format; `bits_per_texel` counts all mips, as in packs."""
    return tuple(
        replace(
            row,
            psnr_db=texture.psnr_db,
            bits_per_texel=8.0 * texture.stored_bytes / (row.width * row.height),
            file_bytes=texture.stored_bytes,
            gpu_bytes=texture.stored_bytes,
        )
        for row, texture in zip(texture_rows(scene, None, None, None), compressed.textures, strict=True)
    )


def filtered(rows: Iterable[TextureRow], text: str) -> list[TextureRow]:
    """Return the rows that have every word of `text` in their name or category; `group:3` selects a group."""
    words = text.casefold().split()
    groups = {word.removeprefix("group:") for word in words if word.startswith("group:")}
    words = [word for word in words if not word.startswith("group:")]

    def fits(row: TextureRow) -> bool:
        described = f"{row.name} {row.category}".casefold()
        return all(word in described for word in words) and (not groups or str(row.group) in groups)

    return [row for row in rows if fits(row)]


def ordered(rows: Iterable[TextureRow], column: TextureColumn, descending: bool) -> list[TextureRow]:
    """Return rows sorted by a column. Equal rows stay in the order of their ids; unknown values are always last."""
    if not descending:
        return sorted(rows, key=lambda row: row.key(column))
    known = [row for row in rows if row.key(column)[0] == 0]
    unknown = [row for row in rows if row.key(column)[0] != 0]
    return sorted(known, key=lambda row: row.key(column), reverse=True) + unknown
