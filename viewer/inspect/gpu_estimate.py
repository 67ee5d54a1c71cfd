"""Estimated times of decoding on a GPU, from instructions that were counted in compiled shaders. Nothing is measured.

gpu_instructions.json holds the instructions. `python -m lab.documentation` makes it of the benchmarks' records.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Final
from weakref import WeakKeyDictionary

from ntc.codec.maps import plane_channels
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from viewer.render.resources.layout import PAGE_SIDE
from viewer.render.tile_cache.budget import TileCounts
from viewer.state.view_state import FILTERED_PATHS, PathChoice, Slot

ESTIMATED_GPU: Final = "AMD RX 7800 XT"
"""The GPU that estimates are for (Navi32)."""
LANE_INSTRUCTIONS: Final = 9.3e12
"""Lane instructions that it issues in a second at most, none of them two at once."""
PIXELS: Final = {"1080p": 1920 * 1080, "4K": 3840 * 2160}
PAGE_TEXELS: Final = PAGE_SIDE * PAGE_SIDE
"""Texels of a tile and its border."""
INSTRUCTIONS_FILE: Final = Path(__file__).with_name("gpu_instructions.json")
_coefficients: WeakKeyDictionary[Pack, float] = WeakKeyDictionary()


@cache
def _counted() -> Mapping[str, Any]:
    found: Mapping[str, Any] = json.loads(INSTRUCTIONS_FILE.read_text(encoding="utf-8"))
    return found


def _planes(pack: Pack) -> int:
    return len(plane_channels(pack.config.maps, pack.config.output_channels))


def _coefficients_of(pack: Pack) -> float:
    if pack not in _coefficients:
        _coefficients[pack] = codec_of(pack.config).gpu_tables(pack.config).coefficients(pack)
    return _coefficients[pack]


def _instructions(pack: Pack, slot: Slot) -> float | None:
    """Return the vector instructions for all planes of a pixel, or by path `cached` of a texel of tiles; None without a count."""
    is_sampled = slot.filter == "stochastic" and slot.path not in FILTERED_PATHS
    path = f"{slot.path}, stochastic" if is_sampled else slot.path
    if pack.config.kind == "block":
        fit: Mapping[str, float] | None = _counted()["block"].get(path)
        if fit is None:
            return None
        return fit["once"] + fit["plane"] * _planes(pack) + fit["coefficient"] * _coefficients_of(pack)
    shape = codec_of(pack.config).gpu_tables(pack.config).shape_text()
    path = "deferred, shared" if path == "deferred" and len(pack.decoders) == 1 else path
    found: float | None = _counted().get(pack.config.kind, {}).get(shape, {}).get(path, {}).get(slot.precision)
    return found


def milliseconds_of(instructions: float) -> float:
    """Return the least time in ms that the GPU takes for vector instructions of its lanes."""
    return instructions / LANE_INSTRUCTIONS * 1e3


def estimated_ms(pack: Pack, slot: Slot) -> Mapping[str, float]:
    """Return the least time in ms of a path that decodes every pixel, by size of the picture, as if all its pixels show `pack`.

    Latencies make it longer. Empty for paths `cached` and `on-load`, and where nobody has counted the instructions.
    """
    own = None if slot.path in FILTERED_PATHS else _instructions(pack, slot)
    return {} if own is None else {name: milliseconds_of(own * pixels) for name, pixels in PIXELS.items()}


def estimated_tile_ms(pack: Pack, slot: Slot) -> float | None:
    """Return the least time in ms that path `cached` takes to decode one tile of one plane, as a mean over planes.

    None for other paths, and where nobody has counted the instructions.
    """
    own = _instructions(pack, slot) if slot.path == "cached" else None
    return None if own is None else milliseconds_of(own * PAGE_TEXELS) / _planes(pack)


def missing_tiles(tiles: TileCounts) -> int:
    """Return the number of tiles that the last view needed and that were not in the cache when it asked for them."""
    return max(0, tiles.resident + tiles.waiting - tiles.kept)


def estimate_lines(
    packs: Mapping[str, Pack], slots: Iterable[Slot], paths: Mapping[Slot, PathChoice], tiles: Mapping[Slot, TileCounts]
) -> list[str]:
    """Return a line for each of `slots` that shows one of `packs`, under a heading; `paths` holds what `auto` chose."""
    lines = []
    for shown in dict.fromkeys(slots):
        if shown.source not in packs:
            continue
        pack, slot = packs[shown.source], replace(shown, path=paths.get(shown, shown.path))
        name = slot.label if slot.path in FILTERED_PATHS else f"{slot.label}, filter {slot.filter}"
        times, tile_ms = estimated_ms(pack, slot), estimated_tile_ms(pack, slot)
        if times:
            text = ", ".join(f"{milliseconds:.1f} ms at {size}" for size, milliseconds in times.items())
        elif tile_ms is not None and shown in tiles:
            missing = missing_tiles(tiles[shown])
            text = f"{missing * tile_ms:.3f} ms for the {missing:,} tiles that the last view lacked"
        else:
            text = "no estimate, for its instructions were not counted"
        lines.append(f"{name}: {text}")
    heading = f"Least time of decoding on {ESTIMATED_GPU}, estimated from counted instructions, not measured:"
    return [heading, *lines] if lines else []
