"""Small packs that together use every feature of the formats, and the texels that decoders must find in them.

`python -m tests.conformance.packs` writes them anew, into `packs/`: NAME.ntc, and NAME.texels with the 8-bit texels of the float64
reference: textures in order, of each its mips from the finest, rows from v = 0, channels side by side.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ntc.api import decode, encode, material, texture
from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.block.encoding.encoder import encode_group, encode_texture
from ntc.codec.config import GroupingConfig
from ntc.codec.encoding import BitsTarget, EncodingOptions
from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.latents import texture_levels
from ntc.codec.maps import MAPS, MapName
from ntc.codec.model import CodecSettings, Grouping, Pack
from ntc.codec.textures import SourceTexture
from ntc.io import write_bytes
from ntc.pack.file import write_pack
from ntc.training.encode import encode_textures

FOLDER = Path(__file__).with_name("packs")


def pixels(width: int, height: int, channels: int, seed: int) -> NDArray[np.uint8]:
    """Return [height, width, channels] uint8: waves with noise, as photographs are."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width]
    waves = [
        np.sin(x * random.uniform(0.1, 0.6) + y * random.uniform(0.1, 0.6) + random.uniform(0, 6)) * 60 + 120
        for _ in range(channels)
    ]
    return np.clip(np.stack(waves, axis=2) + random.normal(0, 9, (height, width, channels)), 0, 255).astype(np.uint8)


def graphics(width: int, height: int, channels: int, seed: int) -> NDArray[np.uint8]:
    """Return [height, width, channels] uint8: discs of plain colours with sharp edges."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width]
    found = np.full((height, width, channels), random.integers(0, 256, channels), np.uint8)
    for _ in range(12):
        inside = (x - random.integers(width)) ** 2 + (y - random.integers(height)) ** 2 < random.integers(20, 200)
        found[inside] = random.integers(0, 256, channels)
    return found


def textures() -> list[SourceTexture]:
    """Return textures of odd sizes, with every wrap mode and number of channels."""
    return [
        texture(pixels(40, 28, 3, 1), "repeats", wrap=("repeat", "mirror")),
        texture(pixels(17, 33, 1, 2), "grey", wrap=("clamp", "repeat")),
        texture(pixels(16, 16, 2, 3), "grey with alpha", wrap=("mirror", "clamp")),
        texture(pixels(1, 9, 4, 4), "one column \u00e9\u4e16\U0001f600", color_space="linear"),
        texture(pixels(32, 32, 4, 5), "colours with alpha"),
    ]


def sets() -> list[SourceTexture]:
    """Return material sets: all maps with alpha, some maps, and one without a base colour."""
    counts: dict[MapName, int] = dict(zip(MAPS, (4, 2, 1, 1, 3, 1), strict=True))
    some: tuple[MapName, ...] = ("base", "normal", "occlusion")
    return [
        material({name: pixels(32, 24, count, 10 + count) for name, count in counts.items()}, "all maps"),
        material({name: graphics(24, 24, min(counts[name], 3), 20) for name in some}, "some maps"),
        material({"normal": pixels(16, 16, 2, 30), "roughness": graphics(16, 16, 1, 31)}, "no base"),
    ]


def masks() -> list[SourceTexture]:
    """Return material sets with alpha: a mask, one that is blended, and one without."""
    disc = graphics(40, 32, 1, 60) // 128 * 255
    return [
        material({"base": pixels(40, 32, 3, 61), "normal": pixels(40, 32, 2, 62), "alpha": disc}, "mask", cutoff=0.4),
        material({"base": graphics(32, 32, 3, 63), "alpha": pixels(32, 32, 1, 64)}, "blended"),
        material({"base": pixels(16, 16, 3, 65), "roughness": pixels(16, 16, 1, 66)}, "no alpha"),
    ]


def _one_group(own: list[SourceTexture]) -> Grouping:
    return Grouping("single", (0,) * len(own))


def _encoded(own: list[SourceTexture], settings: CodecSettings, options: EncodingOptions) -> Pack:
    return encode_textures(own, _one_group(own), settings, options)


def _block(own: list[SourceTexture], settings: BlockConfig) -> Pack:
    return _encoded(own, settings, BlockOptions())


def _own_codes() -> Pack:
    """Return textures of one, two and four mips per code."""
    own = [texture(graphics(64, 48, 3, 70 + mips), f"{mips} mips") for mips in (1, 2, 4)]
    config = BlockConfig(mips=4, block_words=(4, 8, 12), mean_words=7.0, coefficients=80, modes=8)
    decoder, _ = encode_group(own, config)
    fewer: tuple[Literal[1, 2] | None, ...] = (1, 2, None)
    found = [encode_texture(each, decoder, config, 7.0, code_mips=mips) for each, mips in zip(own, fewer, strict=True)]
    return Pack(config, _one_group(own), tuple(found), (decoder,))


def _grid(own: list[SourceTexture], settings: GridConfig) -> Pack:
    return _encoded(own, settings, TrainingConfig(steps=20, texels_per_texture=64, device="cpu"))


def _flat(channels: int = 3) -> list[SourceTexture]:
    return [texture(graphics(64, 48, channels, 40 + number), f"flat {number}") for number in range(3)]


MAKERS: Mapping[str, Callable[[], Pack]] = {
    "block-textures": lambda: _block(textures(), BlockConfig(output_channels=4, coefficients=64, modes=8)),
    "block-one-size": lambda: _block(
        textures()[:1], BlockConfig(block_words=(6,), mean_words=6.0, coefficients=96, modes=16, levels=3)
    ),
    "block-one-mip": lambda: _block(textures()[:2], BlockConfig(mips=1, coefficients=64, modes=8)),
    "block-four-mips": lambda: _block(
        [texture(graphics(64, 64, 3, 50)), texture(pixels(64, 32, 3, 51))],
        BlockConfig(mips=4, block_words=(4, 8, 16), mean_words=8.0, coefficients=120, modes=16),
    ),
    "block-own-codes": _own_codes,
    "block-side-4": lambda: _block(
        textures()[:1], BlockConfig(block_side=4, block_words=(1, 2, 3), mean_words=2.0, coefficients=30, modes=8)
    ),
    "block-flat": lambda: encode(_flat(), target=BitsTarget(5.0), grouping=GroupingConfig("single")),
    "block-sets": lambda: encode(sets(), target=BitsTarget(12.0), grouping=GroupingConfig("single")),
    "block-coverage": lambda: encode(masks(), target=BitsTarget(10.0), grouping=GroupingConfig("single")),
    "block-universal-coverage": lambda: encode(masks(), target=BitsTarget(8.0), grouping=GroupingConfig("universal")),
    "block-universal": lambda: encode(_flat(), target=BitsTarget(3.0), grouping=GroupingConfig("universal")),
    "block-universal-sets": lambda: encode(sets(), target=BitsTarget(9.0), grouping=GroupingConfig("universal")),
    "grid-textures": lambda: _grid(textures(), GridConfig(output_channels=4, hidden_width=16)),
    "grid-adapters": lambda: _grid(
        textures()[:3],
        GridConfig(
            latent_channels=8,
            latent_bits=4,
            hidden_width=16,
            weight_bits=16,
            adapters=True,
            adapter_output=True,
            leaky_slope=0.1,
        ),
    ),
    "grid-one-mip": lambda: _grid(
        textures()[:2], GridConfig(levels=1, downscale=3, positional_octaves=2, hidden_width=8, adapters=True)
    ),
    "grid-sets": lambda: _grid(sets(), GridConfig(output_channels=12, maps=MAPS, hidden_width=12)),
}
"""What makes each pack, by its name."""


def texels(pack: Pack) -> bytes:
    """Return the texels of the float64 reference, as NAME.texels holds them."""
    parts = [
        decode(pack, number, level, "numpy").tobytes()
        for number, own in enumerate(pack.textures)
        for level in range(len(texture_levels(own, pack.config)))
    ]
    return b"".join(parts)


def main() -> None:
    """Write all packs and their texels."""
    for name, make in MAKERS.items():
        pack = make()
        write_pack(FOLDER / f"{name}.ntc", pack)
        write_bytes(FOLDER / f"{name}.texels", texels(pack))


if __name__ == "__main__":
    main()
