"""Fast decoders against the float64 reference, at the same places, for packs of any codec."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from ntc.codec.model import Pack
from ntc.codec.reference import decode_texels
from ntc.codec.registry import codec_of

TORCH_TOLERANCE = 1e-4
Wrap = tuple[WrapMode, WrapMode]
TexelDecode = Callable[[int, NDArray[Any], NDArray[Any], Wrap | None], NDArray[np.floating[Any]]]
"""(texture index, uv [N, 2], lod [N], wrap modes or None) -> [N, channels]."""


def in_float32(values: NDArray[Any]) -> NDArray[np.float64]:
    """`values` as both sides can represent them: float64 numbers that are float32 exactly."""
    return values.astype(np.float32).astype(np.float64)


def largest_difference(
    pack: Pack, decode: TexelDecode, texture: int, uv: NDArray[Any], lod: NDArray[Any], wrap: Wrap | None
) -> float:
    """Largest difference between `decode` and float64 at these float32 requests."""
    expected = decode_texels(pack, texture, in_float32(uv), in_float32(lod), wrap)
    decoded = decode(texture, uv, lod, wrap)
    assert decoded.shape == expected.shape
    return float(np.abs(decoded - expected).max())


def assert_torch_agrees(
    pack: Pack, index: int, uv: NDArray[np.float32], lod: NDArray[np.float32], wrap: Wrap | None
) -> None:
    """Both decode `uv` and `lod` to the same finite numbers in [0, 1]."""
    truth = decode_texels(pack, index, uv.astype(np.float64), lod.astype(np.float64), wrap)
    fast = codec_of(pack.config).torch_twin(pack, "cpu").decode_texels(index, uv, lod, wrap)
    assert truth.shape == fast.shape == (len(uv), pack.textures[index].channels)
    assert np.isfinite(truth).all()
    assert truth.min(initial=0.0) >= 0.0
    assert truth.max(initial=1.0) <= 1.0
    np.testing.assert_allclose(fast, truth, atol=TORCH_TOLERANCE, rtol=0.0)
