"""`ntc.decode_to_moderngl`: a texture of the caller's context holds what the pack decodes to, mip by mip."""

import numpy as np
import pytest

import ntc
from lab.bench.random_pack import random_block_pack
from ntc.codec.block.config import BlockConfig
from viewer.gl.context import GraphicsContext

pytestmark = pytest.mark.once


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_a_texture_holds_all_mips(graphics: GraphicsContext, channels: int) -> None:
    pack = random_block_pack(config=BlockConfig(output_channels=channels, coefficients=32))
    made = ntc.decode_to_moderngl(graphics.gl, pack, 1)
    try:
        assert made.size == (pack.textures[1].width, pack.textures[1].height)
        for level in range(ntc.mip_count(pack, 1)):
            expected = ntc.decode(pack, 1, level)
            height, width = expected.shape[:2]
            found = np.frombuffer(made.read(level=level), np.uint8).reshape(height, width, 4)
            assert (found[..., :channels] == expected).all()
            if channels < 4:
                assert (found[..., 3] == 255).all()
            if channels == 1:
                assert (found[..., :3] == expected).all()
    finally:
        made.release()


def test_a_map_that_is_not_there_is_refused(graphics: GraphicsContext) -> None:
    with pytest.raises(ntc.InputError, match="no map normal"):
        ntc.decode_to_moderngl(graphics.gl, random_block_pack(), 0, "normal")
