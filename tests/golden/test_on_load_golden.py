"""Small textures of every shape by path on-load look as they did when somebody last looked.

`python -m tests.golden.test_on_load_golden` draws the picture anew. Look at it before committing.
"""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.random_pack import random_pack
from ntc.codec.mips import linear_to_srgb8
from tests.gl.small_scenes import FRONT, objects
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.render.renderer import Renderer
from viewer.scene.images import read_image, write_png
from viewer.state.view_state import Slot, ViewState

FILE = Path(__file__).parent / "llvmpipe" / "on-load" / "objects.png"
SIZES = ((16, 16), (18, 10), (9, 17), (64, 64))
"""Sizes in texels of the textures: their texels are seen one by one."""


def drawn(context: GraphicsContext) -> NDArray[np.uint8]:
    """[H, W, 3] uint8 sRGB."""
    scene, slot = objects(), Slot("p", "on-load")
    hashes = [own.pixel_hash for own in scene.textures]
    renderer = Renderer(context, scene)
    renderer.set_packs({"p": random_pack(SIZES, (0, 1, 0, 1), hashes=hashes)})
    renderer.render(ViewState(FRONT, (240, 150), slot))
    picture = linear_to_srgb8(renderer.picture(slot))
    renderer.release()
    return picture


@pytest.mark.gl
def test_compressed_textures_are_as_accepted() -> None:
    context = create_headless_context()
    if not context.features.compute:
        pytest.skip("path on-load needs compute shaders")
    picture, accepted = drawn(context), read_image(FILE)[..., :3]
    assert accepted.std() > 20.0
    # Other drivers filter, and cut off values of a block, in their own way.
    difference = np.abs(picture.astype(int) - accepted).max(axis=2)
    assert (difference > 2).mean() <= 0.001
    context.gl.release()


def main() -> None:
    """Replace the accepted picture."""
    FILE.parent.mkdir(parents=True, exist_ok=True)
    write_png(FILE, drawn(create_headless_context()))


if __name__ == "__main__":
    main()
