"""Packs of format 1 of codec `block` in GLSL against their float64 twin."""

from pathlib import Path

import numpy as np
import pytest

from ntc.pack.file import read_pack
from tests.support.packs.parity import largest_difference
from viewer.gl.context import GraphicsContext
from viewer.render.passes.decode_texels import GlTexelDecoder

pytestmark = pytest.mark.computes

FOLDER = Path("tests/unit/ntc/codec/block/format_1")


@pytest.mark.parametrize("name", ["colours", "sets"])
def test_old_packs_decode_alike(graphics: GraphicsContext, name: str) -> None:
    pack = read_pack(FOLDER / f"{name}.ntc")
    decoder = GlTexelDecoder(graphics, pack)
    random = np.random.default_rng(1)
    for texture in range(2):
        uv, lod = random.uniform(-2.0, 2.0, (400, 2)), random.uniform(0.0, 3.0, 400)
        assert largest_difference(pack, decoder.decode_texels, texture, uv, lod, ("mirror", "clamp")) <= 1e-4
    decoder.release()
