"""The image of latents, which software renderers read, holds what the store's buffer holds."""

import numpy as np
import pytest

from lab.bench.random_pack import random_block_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.registry import codec_of
from viewer.gl.context import GraphicsContext
from viewer.render.resources.latent_store import LatentBudget, LatentImage, LatentStore, LatentUpdate

CONFIG = BlockConfig(block_words=(3,), mean_words=3.0, modes=16, coefficients=60)
SIZES = [(256, 256), (64, 128), (512, 256)]


@pytest.fixture
def store(graphics: GraphicsContext) -> LatentStore:
    pack = random_block_pack(SIZES, (0, 0, 0), CONFIG)
    return LatentStore(graphics, codec_of(CONFIG).gpu_tables(CONFIG), pack.textures, LatentBudget())


def agrees(image: LatentImage, store: LatentStore) -> bool:
    """Whether the image holds the bytes of the buffer that are in use."""
    used = int(store.bytes_by_texture.sum())
    return image.update().read()[:used] == store.buffer.read(used)


def test_an_image_follows_what_is_loaded_and_replaced(store: LatentStore) -> None:
    image = LatentImage(store)
    for wanted in ({0: 4}, {1: 0}, {0: 0}, {2: 3}, {2: 0}):
        assert store.ensure_resident(wanted)
        assert agrees(image, store), wanted
    assert image.size >= store.buffer.size
    # Of the same sizes, so that they are replaced in place.
    textures = random_block_pack(SIZES, (0, 0, 0), CONFIG, seed=1).textures
    update = LatentUpdate(store, {1: textures[1], 2: textures[2]})
    assert update.fits
    before = np.frombuffer(store.buffer.read(), np.uint32)
    update.stage(4096)
    update.apply()
    assert not np.array_equal(np.frombuffer(store.buffer.read(), np.uint32), before)
    assert agrees(image, store)
    image.release()
    assert agrees(image, store)
    image.release()
    store.release()
