"""Whole materials under tables that ship, in GLSL against their float64 twin."""

import numpy as np
import pytest

from ntc.codec.block.config import BlockOptions
from ntc.codec.block.encoding.rate import config_for_bits
from ntc.codec.config import GroupingConfig
from ntc.codec.encoding import texture_set
from ntc.codec.maps import BASE_ALONE, MAPS
from ntc.grouping import make_grouping
from ntc.training.encode import encode_textures
from tests.support.packs.parity import largest_difference
from tests.unit.ntc.codec.block.test_material_sets import WHOLE, material
from viewer.gl.context import GraphicsContext
from viewer.render.passes.decode_texels import GlTexelDecoder

pytestmark = [pytest.mark.computes, pytest.mark.driver]
TOLERANCE = 1e-4


def test_scaled_tables_decode_as_the_reference_does(graphics: GraphicsContext) -> None:
    sources = [material(maps, (64, 48), seed=number) for number, maps in enumerate((WHOLE, MAPS, BASE_ALONE))]
    grouping = make_grouping(GroupingConfig("universal"), sources)
    config = config_for_bits(6.0, texture_set(sources, grouping.stored_decoders))
    pack = encode_textures(sources, grouping, config, BlockOptions())
    decoder = GlTexelDecoder(graphics, pack)
    random = np.random.default_rng(0)
    for texture in range(len(sources)):
        uv = random.uniform(-2.0, 3.0, (500, 2)).astype(np.float32)
        lod = random.uniform(-1.0, 7.0, 500).astype(np.float32)
        assert largest_difference(pack, decoder.decode_texels, texture, uv, lod, None) < TOLERANCE
    decoder.release()
