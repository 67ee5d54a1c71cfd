"""Alpha in codec `block`: a map of the set, tested or blended, beside a fourth channel of the base and a texture of its own.

python -m lab.benchmarks.masks FOLDER --json FILE: every image of the folder with alpha. *Bits of alpha* are those of its edge parts
and coefficients in all codes; of a texture of its own all bits. *Wrong* is the share of texels beside the mask's edge that fall on the
other side of the cutoff. *Coverage* is the share of texels at or above the cutoff: of the original, and of mips less that.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.runner import options, report, run
from ntc.api import decode, encode, material, texture
from ntc.codec.block.codes import bit_places
from ntc.codec.block.model import block_parts
from ntc.codec.block.reference import texture_codes
from ntc.codec.config import GroupingConfig
from ntc.codec.encoding import BitsTarget
from ntc.codec.latents import texture_levels
from ntc.codec.model import Pack
from ntc.codec.quality import finite_or_none, psnr_db
from ntc.codec.textures import SourceTexture
from viewer.scene.images import folder_images, read_image

MIPS = 5
ALPHA_ALONE_BITS = 0.57
Pixels = NDArray[np.uint8]


def edge_texels(above: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return [H, W] which texels of a mask have a neighbour on the other side."""
    found = np.zeros_like(above)
    for axis in (0, 1):
        other = above != np.roll(above, 1, axis)
        np.moveaxis(other, axis, 0)[0] = False
        found |= other | np.roll(other, -1, axis)
    return found


def alpha_bits(pack: Pack, index: int) -> float | None:
    """Return the bits per texel of mip 0 that codes of texture `index` have for the map `alpha`: edge parts and coefficients. None
    without that map."""
    own = block_parts(pack)
    config, found = own.config, own.textures[index]
    if config.alpha is None:
        return None
    decoder, plane, total = own.decoders[found.group], len(config.planes) - 1, 0
    for number, level in enumerate(texture_levels(found, config)):
        if level.has_own_cells:
            stored = texture_codes(found, config, number)
            modes = (stored.codes[:, 0] & np.uint32(config.modes - 1)).astype(np.int64)
            bits = decoder.fitting_edges(config)[stored.sizes, modes, plane]
            total += sum(config.edge_part_bits(plane, int(own_bits)) for own_bits in bits)
            depths = bit_places(modes, stored.sizes, decoder, config).depths
            total += int(depths[:, decoder.channels == config.alpha].sum())
    return total / (found.width * found.height)


def _stored_bits(pack: Pack, index: int) -> float:
    own = block_parts(pack).textures[index]
    return 8.0 * own.words.nbytes / (own.width * own.height)


def _mask(name: str, pixels: Pixels, cutoff: float | None) -> SourceTexture:
    return material({"base": pixels[..., :3], "alpha": pixels[..., 3:]}, name, cutoff=cutoff)


KINDS: Mapping[str, Callable[[str, Pixels, float], SourceTexture]] = {
    "mask": _mask,
    "blended": lambda name, pixels, _: _mask(name, pixels, None),
    "fourth channel": lambda name, pixels, _: texture(pixels, name),
    "alone": lambda name, pixels, _: texture(np.ascontiguousarray(pixels[..., 3:]), name, "linear"),
}


def rows_of(kind: str, images: Mapping[str, Pixels], bits: float, cutoff: float) -> Iterator[dict[str, Any]]:
    """Yield a row for each of `images` [H, W, 4], encoded together at `bits`."""
    sources = [KINDS[kind](name, pixels, cutoff) for name, pixels in images.items()]
    pack = encode(sources, target=BitsTarget(bits), grouping=GroupingConfig("single"))
    for index, (name, pixels) in enumerate(images.items()):
        shown = [decode(pack, index, mip) for mip in range(MIPS)]
        alpha = shown[0][..., -1]
        above, found = (each >= 255.0 * cutoff for each in (pixels[..., 3], alpha))
        edge = edge_texels(above)
        whole = _stored_bits(pack, index)
        yield {
            "texture": name,
            "alpha": kind,
            "bits": whole,
            "bits of alpha": whole if kind == "alone" else alpha_bits(pack, index),
            "colour dB": None if kind == "alone" else finite_or_none(psnr_db(shown[0][..., :3], pixels[..., :3])),
            "alpha dB": finite_or_none(psnr_db(alpha, pixels[..., 3])),
            "wrong, %": 100.0 * float((found != above)[edge].mean()),
            "coverage, %": 100.0 * float(above.mean()),
            **{
                f"mip {mip}, %": 100.0 * float((each[..., -1] >= 255.0 * cutoff).mean() - above.mean())
                for mip, each in enumerate(shown[1:], 1)
            },
        }


def means(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the means of `rows` of one kind; of the coverage of mips, those of how far it is off."""
    found: dict[str, Any] = {"texture": "mean", "alpha": rows[0]["alpha"]}
    for key in list(rows[0])[2:]:
        values = [row[key] for row in rows if row[key] is not None]
        found[key] = float(np.mean(np.abs(values))) if values else None
    return found


def main() -> None:
    """Run the benchmark. Raises InputError."""
    parser = options(__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--bits", type=float, nargs="+", default=[2.0, 3.0])
    parser.add_argument("--cutoff", type=float, default=0.5)
    given = parser.parse_args()
    images = {path.stem: read_image(path) for path in folder_images(given.folder)}
    images = {name: pixels for name, pixels in images.items() if pixels.shape[2] == 4}
    rows: list[Mapping[str, Any]] = []
    for kind in KINDS:
        for bits in [ALPHA_ALONE_BITS] if kind == "alone" else given.bits:
            own = list(rows_of(kind, images, bits, given.cutoff))
            rows += [*own, means(own)]
    facts = {"textures": len(images), "bits": given.bits, "cutoff": given.cutoff}
    report(
        "Alpha",
        [{k: round(v, 3) if isinstance(v, float) else v for k, v in row.items()} for row in rows],
        facts,
        given.json,
    )


if __name__ == "__main__":
    run(main)
