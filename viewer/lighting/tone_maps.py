"""Exposure and tone maps in float64, the twins of shaders/lighting/tone_map.glsl.

A tone map compresses linear radiance, which has no upper limit, to linear values in [0, 1] that a display can show. `none` clips.
Khronos PBR Neutral leaves colours below 0.8 true, for judging base colours. AgX rolls off like film: bright colours turn white.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np

from viewer.lighting.directions import Array
from viewer.state.view_state import ToneMap

_AGX_INSET = np.array(
    [
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ]
)
_AGX_OUTSET = np.array(
    [
        [1.19687900512017, -0.0980208811401368, -0.0990297440797205],
        [-0.0528968517574562, 1.15190312990417, -0.0989611768448433],
        [-0.0529716355144438, -0.0980434501171241, 1.15107367264116],
    ]
)
AGX_STOPS: Final = (-12.47393, 4.026069)
"""Darkest and brightest radiance that AgX distinguishes, as log2."""


def _none(radiance: Array) -> Array:
    return np.clip(radiance, 0.0, 1.0)


def _neutral(radiance: Array) -> Array:
    """Apply Khronos PBR Neutral (KhronosGroup/ToneMapping): a toe, then compression and desaturation of bright colours.

    The toe subtracts the Fresnel reflection of 4 % that a dielectric adds to its base colour, less of it for dark colours. A largest
    component p above 0.76 becomes 1 - d^2 / (p - 0.76 + d), with d = 0.24: value and slope are continuous, and the limit is 1. The
    more p is compressed, the more the colour is blended towards grey.
    """
    start, desaturation = 0.8 - 0.04, 0.15
    lowest = radiance.min(axis=-1, keepdims=True)
    color = radiance - np.where(lowest < 0.08, lowest - 6.25 * lowest * lowest, 0.04)
    peak = color.max(axis=-1, keepdims=True)
    span = 1.0 - start
    compressed = 1.0 - span * span / (np.maximum(peak, start) + span - start)
    share = 1.0 - 1.0 / (desaturation * (peak - compressed) + 1.0)
    bright = color * compressed / np.maximum(peak, start)
    mapped = np.where(peak < start, color, bright + (compressed - bright) * share)
    return np.clip(mapped, 0.0, 1.0)


def _agx(radiance: Array) -> Array:
    """Apply AgX (Sobotka) as fitted by Wrensch 2023, "Minimal AgX Implementation".

    The inset matrix mixes the components, so that saturated lights become white and not a clipped primary. The curve, a polynomial of
    degree 6, acts on log2 between AGX_STOPS. The outset matrix undoes most of the mix. The result is display-encoded with a gamma of
    2.2, which is decoded here.
    """
    low, high = AGX_STOPS
    encoded = np.log2(np.maximum(radiance @ _AGX_INSET.T, 2.0**low))
    x = (np.clip(encoded, low, high) - low) / (high - low)
    x2 = x * x
    x4 = x2 * x2
    curve = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232
    linear: Array = np.clip(curve @ _AGX_OUTSET.T, 0.0, 1.0) ** 2.2
    return linear


TONE_MAPS: Final[Mapping[ToneMap, Callable[[Array], Array]]] = MappingProxyType(
    {"none": _none, "neutral": _neutral, "agx": _agx}
)
"""Tone maps by name: linear radiance [..., 3], at least 0 -> linear picture [..., 3] in [0, 1]."""


def tone_mapped(radiance: Array, exposure: float, tone_map: ToneMap) -> Array:
    """Return the picture [..., 3], linear in [0, 1], of `radiance` [..., 3]; `exposure` in stops."""
    return TONE_MAPS[tone_map](np.maximum(radiance, 0.0) * 2.0**exposure)
