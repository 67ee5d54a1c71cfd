"""Tables of quality and size of packs."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ntc.codec.model import Pack
from ntc.codec.quality import PsnrSummary, finite_or_none
from ntc.codec.registry import codec_of


@dataclass(frozen=True)
class PsnrTable:
    """Quality and size of every texture of a pack."""

    rows: tuple[dict[str, Any], ...]
    summary: PsnrSummary | None
    bits_per_texel: float
    """Stored bits (latents with scale and offset, decoders, adapters) per texel of mip 0, mips included. The unit of `encode
    --bits`."""
    latent_bytes: int
    decoder_bytes: int
    adapter_bytes: int

    def json(self) -> dict[str, Any]:
        """Return the table as JSON values; an infinite PSNR becomes null."""
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
        """Return the table as text, worst texture first."""
        width = max((len(row["name"]) for row in self.rows), default=7)
        lines = [f"{'texture':{width}} {'size':>11} {'group':>5} {'PSNR dB':>8} {'latents kB':>10}"]
        ordered = sorted(self.rows, key=lambda row: math.inf if row["psnr_db"] is None else row["psnr_db"])
        for row in ordered:
            size = f"{row['width']}x{row['height']}"
            kilobytes = row["latent_bits_per_texel"] * row["width"] * row["height"] / 8e3
            psnr = "-" if row["psnr_db"] is None else f"{row['psnr_db']:.2f}"
            lines.append(f"{row['name']:{width}} {size:>11} {row['group']:>5} {psnr:>8} {kilobytes:>10.1f}")
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
        lines += [f"size: {sizes}", f"bits: {self.bits_per_texel:.2f} per texel of mip 0"]
        return lines


def _map_line(row: Mapping[str, Any]) -> str:
    """Return a line with the maps of a material set, and the quality of each if it is known."""
    map_psnr, degrees = row["map_psnr_db"], row["normal_degrees"]
    parts = []
    for name in row["maps"]:
        quality = "" if name not in map_psnr else " exact" if map_psnr[name] is None else f" {map_psnr[name]:.2f} dB"
        angle = f" ({degrees[0]:.2f} degrees, 95 % below {degrees[1]:.2f})" if name == "normal" and degrees else ""
        parts.append(f"{name}{quality}{angle}")
    return ", ".join(parts)


def bits_with_mips(pack: Pack) -> float:
    """Return the bitrate of `pack` in bits per texel of mip 0, with all mips and decoders."""
    return psnr_table(pack).bits_per_texel


def psnr_table(pack: Pack) -> PsnrTable:
    """Return the table of `pack`. PSNRs are those that the encoder measured after quantisation."""
    codec = codec_of(pack.config)
    sizes = [codec.texture_bytes(texture, pack.config) for texture in pack.textures]
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
            "latent_bits_per_texel": 8.0 * size.latents / (texture.width * texture.height),
        }
        for texture, size in zip(pack.textures, sizes, strict=True)
    )
    stored = codec.stored_decoders(pack.grouping.name, len(pack.decoders), pack.config)
    decoder_bytes = sum(codec.decoder_bytes(decoder, pack.config) for decoder in pack.decoders[:stored])
    latent_bytes = sum(each.latents + each.constants for each in sizes)
    adapter_bytes = sum(each.adapter for each in sizes)
    stored_bits = 8.0 * (latent_bytes + decoder_bytes + adapter_bytes)
    texels = sum(texture.width * texture.height for texture in pack.textures)
    return PsnrTable(
        rows=rows,
        summary=PsnrSummary.of([texture.psnr_db for texture in pack.textures if texture.psnr_db is not None]),
        bits_per_texel=stored_bits / max(1, texels),
        latent_bytes=latent_bytes,
        decoder_bytes=decoder_bytes,
        adapter_bytes=adapter_bytes,
    )
