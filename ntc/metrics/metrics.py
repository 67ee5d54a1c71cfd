"""Quality and size of packs."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.latents import latent_levels
from ntc.codec.model import Adapter, Pack
from ntc.errors import InputError


def finite_or_none(value: float | None) -> float | None:
    """`value`, or None where JSON cannot hold it: the PSNR of equal images is infinite."""
    return value if value is not None and math.isfinite(value) else None


def mean_square_error(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    """Mean of squared differences, in units of 8-bit steps squared. `a` and `b` have one shape."""
    difference = a.astype(np.float64) - b.astype(np.float64)
    return float(np.mean(difference * difference)) if difference.size else 0.0


def psnr_of_mse(mean_square: float) -> float:
    """PSNR in dB of a mean square error in 8-bit steps squared; infinity for 0."""
    return math.inf if mean_square <= 0.0 else 10.0 * math.log10(255.0**2 / mean_square)


def mse_of_psnr(psnr: float) -> float:
    """Mean square error in 8-bit steps squared of a PSNR in dB; 0 for infinity."""
    return float(255.0**2 * 10.0 ** (-psnr / 10.0))


def psnr_db(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    """PSNR in dB over 8-bit values (for pictures: sRGB RGB) of two arrays of one shape; infinity when equal."""
    return psnr_of_mse(mean_square_error(a, b))


def worst_share_db(psnrs_db: Sequence[float], share: float = 0.05) -> float:
    """Mean of the lowest `share` in (0, 1] of per-texture PSNRs in dB, their number rounded up, so at least one.

    Infinite when one of them is. Raises InputError for no PSNR, one that is not a number, and another `share`.
    """
    if not 0.0 < share <= 1.0:
        raise InputError(f"worst PSNR: share is {share}; set it above 0 and up to 1")
    if len(psnrs_db) == 0 or any(math.isnan(value) for value in psnrs_db):
        raise InputError("worst PSNR: needs PSNRs in dB, one at least and all of them numbers")
    # 0.07 of 100 is a little more than 7 in floating point, and must not become 8.
    count = max(1, math.ceil(share * len(psnrs_db) - 1e-9))
    return float(np.mean(np.sort(np.asarray(psnrs_db, np.float64))[:count]))


@dataclass(frozen=True)
class PsnrSummary:
    """Per-texture PSNR in five numbers: a mean of dB alone hides bad textures behind easy ones."""

    mean_db: float
    median_db: float
    minimum_db: float
    worst_share_db: float
    """Mean of the worst 5 % of the textures."""
    of_mean_mse_db: float
    """PSNR of the mean over textures of their mean square errors."""

    @classmethod
    def of(cls, values_db: Sequence[float]) -> "PsnrSummary | None":
        """Summary of per-texture PSNRs in dB; None for none."""
        if not values_db:
            return None
        values = np.asarray(values_db, np.float64)
        mean_square = float(np.mean(255.0**2 * 10.0 ** (-values / 10.0)))
        return cls(
            mean_db=float(values.mean()),
            median_db=float(np.median(values)),
            minimum_db=float(values.min()),
            worst_share_db=worst_share_db(values_db),
            of_mean_mse_db=psnr_of_mse(mean_square),
        )


@dataclass(frozen=True)
class PsnrTable:
    """Quality and size of every texture of a pack."""

    rows: tuple[dict[str, Any], ...]
    summary: PsnrSummary | None
    bits_per_texel: float
    """Stored bits (latents with scale and offset, decoders, adapters) per texel of mip 0."""
    latent_bytes: int
    decoder_bytes: int
    adapter_bytes: int

    def json(self) -> dict[str, Any]:
        """Everything as JSON values; an infinite PSNR becomes null."""
        summary = None
        if self.summary is not None:
            summary = {name: finite_or_none(value) for name, value in vars(self.summary).items()}
        return {
            "psnr_db": summary,
            "bits_per_texel": self.bits_per_texel,
            "latent_bytes": self.latent_bytes,
            "decoder_bytes": self.decoder_bytes,
            "adapter_bytes": self.adapter_bytes,
            "textures": [{**row, "psnr_db": finite_or_none(row["psnr_db"])} for row in self.rows],
        }

    def lines(self) -> list[str]:
        """The table as text, worst texture first."""
        lines = [f"{'texture':40} {'size':>11} {'group':>5} {'PSNR dB':>8} {'bits/texel':>10}"]
        ordered = sorted(self.rows, key=lambda row: math.inf if row["psnr_db"] is None else row["psnr_db"])
        for row in ordered:
            size = f"{row['width']}x{row['height']}"
            psnr = "-" if row["psnr_db"] is None else f"{row['psnr_db']:.2f}"
            lines.append(
                f"{row['name'][:40]:40} {size:>11} {row['group']:>5} {psnr:>8} {row['latent_bits_per_texel']:>10.2f}"
            )
            if len(row["maps"]) > 1 or row["maps"][0] != "base":
                lines.append(f"    {_map_line(row)}")
        if self.summary is not None:
            lines.append(
                f"PSNR: mean {self.summary.mean_db:.2f} dB, median {self.summary.median_db:.2f} dB, "
                f"worst 5 % {self.summary.worst_share_db:.2f} dB, min {self.summary.minimum_db:.2f} dB, "
                f"of the mean MSE {self.summary.of_mean_mse_db:.2f} dB"
            )
        parts = {"latents": self.latent_bytes, "decoders": self.decoder_bytes, "adapters": self.adapter_bytes}
        sizes = ", ".join(f"{size / 1e6:.2f} MB {name}" for name, size in parts.items() if size or name != "adapters")
        lines.append(f"size: {self.bits_per_texel:.2f} bits/texel in all ({sizes})")
        return lines


def _map_line(row: Mapping[str, Any]) -> str:
    """The maps of a material set, with the quality of each where it is known."""
    found, degrees = row["map_psnr_db"], row["normal_degrees"]
    parts = []
    for name in row["maps"]:
        quality = "" if name not in found else " exact" if found[name] is None else f" {found[name]:.2f} dB"
        angle = f" ({degrees[0]:.2f} degrees, 95 % below {degrees[1]:.2f})" if name == "normal" and degrees else ""
        parts.append(f"{name}{quality}{angle}")
    return ", ".join(parts)


def _adapter_bytes(adapter: Adapter) -> int:
    parts = (adapter.scales, adapter.biases, adapter.output_weight, adapter.output_bias)
    # Stored in half precision: two bytes a number.
    return sum(2 * part.size for part in parts if part is not None)


def _decoder_bytes(pack: Pack) -> int:
    if isinstance(pack.config, BlockCodecConfig):
        stored = pack.block_decoders[: pack.grouping.stored_decoders]
        return sum(decoder.stored_bits(pack.config) for decoder in stored) // 8
    numbers = sum(array.size for decoder in pack.grid_decoders for array in (*decoder.weights, *decoder.biases))
    return numbers * pack.config.weight_bits // 8


def bits_with_mips(pack: Pack) -> float:
    """Bits of latents, decoders and adapters per texel of all encoded mips."""
    table = psnr_table(pack)
    levels = [level for each in pack.textures for level in latent_levels(each.width, each.height, pack.config)]
    texels = sum(level.texel_width * level.texel_height for level in levels)
    return 8.0 * (table.latent_bytes + table.decoder_bytes + table.adapter_bytes) / max(1, texels)


def psnr_table(pack: Pack) -> PsnrTable:
    """The table of `pack`; PSNR as the encoder measured it after quantisation."""
    rows = tuple(
        {
            "name": texture.name,
            "pixel_hash": texture.pixel_hash,
            "width": texture.width,
            "height": texture.height,
            "channels": texture.channels,
            "maps": list(texture.maps),
            "category": texture.category,
            "group": texture.group,
            "psnr_db": texture.psnr_db,
            "map_psnr_db": dict(zip(texture.maps, map(finite_or_none, texture.map_psnr_db), strict=False)),
            "normal_degrees": list(texture.normal_degrees) if texture.normal_degrees else None,
            "latent_bits_per_texel": 8.0
            * len(texture.latents)
            * pack.config.cell_bytes
            / (texture.width * texture.height),
        }
        for texture in pack.textures
    )
    cell_bytes = pack.config.cell_bytes
    latent_bytes = sum(len(t.latents) * cell_bytes + t.scale.nbytes + t.offset.nbytes for t in pack.textures)
    decoder_bytes = _decoder_bytes(pack)
    adapter_bytes = sum(_adapter_bytes(texture.adapter) for texture in pack.textures if texture.adapter is not None)
    texels = sum(texture.width * texture.height for texture in pack.textures)
    return PsnrTable(
        rows=rows,
        summary=PsnrSummary.of([texture.psnr_db for texture in pack.textures if texture.psnr_db is not None]),
        bits_per_texel=8.0 * (latent_bytes + decoder_bytes + adapter_bytes) / max(1, texels),
        latent_bytes=latent_bytes,
        decoder_bytes=decoder_bytes,
        adapter_bytes=adapter_bytes,
    )
