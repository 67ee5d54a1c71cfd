"""The binned path: every pixel is put into the list once, at its decoder's place, and decoded as the deferred path decodes it."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.fixture import interleaved_words, white_material
from lab.bench.random_pack import square_pack
from ntc.codec.grid.model import GridConfig
from tests.support.covering import covering
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, ShaderLibrary
from viewer.locations import shaders_folder
from viewer.render.passes.decode import DecodeBinnedPass, DecodeDeferredPass
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.layout import BIN_RECORD, scene_includes
from viewer.render.resources.pack_buffers import DecoderRanges, PackBuffers, codec_programs
from viewer.render.resources.visibility_buffer import PlaneReading, SurfaceContent, VisibilityInputs, VisibilityTarget
from viewer.state.view_state import Precision

pytestmark = [pytest.mark.computes, pytest.mark.driver]

SMALL = GridConfig(hidden_width=8, positional_octaves=1)
FULL = GridConfig(
    hidden_width=12, latent_channels=8, latent_bits=4, adapters=True, adapter_output=True, output_channels=4, levels=2
)
Words = NDArray[np.uint32]


def with_background(words: Words) -> Words:
    """Every seventh pixel sees nothing, every fifth a material without a texture."""
    number = np.arange(words.shape[0] * words.shape[1]).reshape(words.shape[:2])
    words[..., 0] = np.where(number % 5 == 0, words[..., 0] & np.uint32(0xFFFF0000), words[..., 0])
    words[..., 0] = np.where(number % 7 == 0, np.uint32(0), words[..., 0])
    return words


def same_texture(words: Words) -> Words:
    """All see texture 0."""
    words[..., 0] = (words[..., 0] & np.uint32(0xFFFF0000)) | np.uint32(1)
    return words


def hostile(words: Words) -> Words:
    """Coordinates and footprints that are no sensible numbers."""
    values = np.array([np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-45, 0.0, -7.25], np.float32).view(np.uint32)
    random = np.random.default_rng(1)
    words[..., 1:] = values[random.integers(0, len(values), words[..., 1:].shape)]
    return words


@pytest.mark.parametrize(
    ("change", "content", "kind"),
    covering(
        [with_background, same_texture, hostile, np.zeros_like],
        [(1, (64, 64)), (3, (37, 23)), (64, (130, 9)), (700, (61, 40))],
        [(SMALL, "fp32", True), (FULL, "fp16", False)],
    ),
)
def test_each_pixel_is_decoded_once_as_on_the_deferred_path(
    graphics: GraphicsContext,
    change: Callable[[Words], Words],
    content: tuple[int, tuple[int, int]],
    kind: tuple[GridConfig, Precision, bool],
) -> None:
    (decoders, size), (codec, precision, shared_sums) = content, kind
    pack = square_pack(decoders, decoders, 16, codec)
    words = change(interleaved_words(size, decoders))
    visibility = VisibilityTarget(graphics, size, SurfaceContent(False, False))
    visibility.write(words)
    library = ShaderLibrary(shaders_folder(), scene_includes())
    buffers, ranges = PackBuffers(graphics, pack, range(decoders), precision), DecoderRanges(graphics, pack, precision)
    programs = codec_programs(ProgramFactory(graphics.gl, library), pack, buffers.variant)
    material, targets = (
        white_material(graphics),
        [ColorTarget(graphics, size) for _ in range(2)],
    )
    deferred = DecodeDeferredPass(graphics, programs, buffers, ranges, PlaneReading(), None)
    adding = replace(graphics, features=replace(graphics.features, shared_sums=shared_sums))
    binned = DecodeBinnedPass(adding, programs, buffers, ranges, PlaneReading())
    inputs = VisibilityInputs(visibility, material, textures=tuple(range(decoders)))
    deferred.run(inputs, targets[0])
    texture = (words[..., 0] & 0xFFFF).astype(int) - 1
    expected = np.bincount(texture[texture >= 0], minlength=decoders)
    for _ in range(2):
        # A second frame finds the bins empty again.
        binned.run(inputs, targets[1])
        bins = np.frombuffer(binned._bins.read(), BIN_RECORD)
        np.testing.assert_array_equal(bins["pixels"], expected)
        np.testing.assert_array_equal(bins["first"], np.cumsum(expected) - expected)
        np.testing.assert_allclose(targets[1].read(), targets[0].read(), atol=2e-5, rtol=0.0)
    everything: tuple[Any, ...] = (*targets, material, binned, ranges, buffers, programs)
    for made in everything:
        made.release()


def test_a_decoder_that_is_not_seen_is_not_run(graphics: GraphicsContext) -> None:
    pack = square_pack(4, 4, 16, SMALL)
    visibility = VisibilityTarget(graphics, (64, 64), SurfaceContent(False, False))
    visibility.write(same_texture(interleaved_words((64, 64), 4)))
    library = ShaderLibrary(shaders_folder(), scene_includes())
    buffers, ranges = PackBuffers(graphics, pack, range(4), "fp32"), DecoderRanges(graphics, pack, "fp32")
    programs = codec_programs(ProgramFactory(graphics.gl, library), pack, buffers.variant)
    material, target = (
        white_material(graphics),
        ColorTarget(graphics, (64, 64)),
    )
    binned = DecodeBinnedPass(graphics, programs, buffers, ranges, PlaneReading())
    binned.run(VisibilityInputs(visibility, material, textures=(0, 1, 2, 3)), target)
    groups = np.frombuffer(binned._bins.read(), BIN_RECORD)["groups_x"]
    assert groups.tolist() == [64 * 64 // 256, 0, 0, 0]
    for made in (target, material, binned, ranges, buffers, programs):
        made.release()
