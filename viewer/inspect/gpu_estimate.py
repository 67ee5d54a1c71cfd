"""Estimated times of decoding on a GPU, from instructions that were counted in compiled shaders. Nothing is measured."""

from collections.abc import Mapping
from typing import Final
from weakref import WeakKeyDictionary

from ntc.codec.gpu import PixelInstructions
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of

ESTIMATED_GPU: Final = "AMD RX 7800 XT"
"""The GPU that estimates are for (Navi32)."""
LANE_INSTRUCTIONS: Final = 9.3e12
"""Lane instructions that it issues in a second at most, none of them two at once."""
PIXELS: Final = {"1080p": 1920 * 1080, "4K": 3840 * 2160}
_found: WeakKeyDictionary[Pack, PixelInstructions | None] = WeakKeyDictionary()


def estimated_ms(pack: Pack, texel_filter: str) -> Mapping[str, float]:
    """Return the least time in ms of path `deferred` by size of the picture, as if all its pixels show `pack`.

    Latencies make it longer. Empty for codecs whose instructions nobody has counted.
    """
    if pack not in _found:
        _found[pack] = codec_of(pack.config).gpu_tables(pack.config).pixel_instructions(pack)
    instructions = _found[pack]
    if instructions is None:
        return {}
    own = instructions.stochastic if texel_filter == "stochastic" else instructions.exact
    return {name: own * pixels / LANE_INSTRUCTIONS * 1e3 for name, pixels in PIXELS.items()}
