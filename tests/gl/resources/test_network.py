"""How the network is laid out changes no number: where weights lie, and how many pixels an invocation decodes."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.fixture import interleaved_words, white_material
from lab.bench.random_pack import square_pack
from ntc.codec.gpu import GPU, SOFTWARE, DecoderVariant
from ntc.codec.grid.model import GridConfig
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, ShaderLibrary
from viewer.locations import shaders_folder
from viewer.render.passes.decode import DecodeBinnedPass, DecodeDeferredPass
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.layout import scene_includes
from viewer.render.resources.pack_buffers import DecoderRanges, PackBuffers, codec_programs
from viewer.render.resources.visibility_buffer import PlaneReading, SurfaceContent, VisibilityInputs, VisibilityTarget
from viewer.state.view_state import Precision

SIZE = (37, 50)
PLAIN = GridConfig(hidden_width=12, positional_octaves=1)
ADAPTED = GridConfig(
    hidden_width=8,
    latent_channels=8,
    latent_bits=4,
    positional_octaves=1,
    adapters=True,
    adapter_output=True,
    output_channels=4,
)
LEAST = GridConfig(hidden_width=4, positional_octaves=1)
OTHERS = GPU, DecoderVariant(3, 2, "image", 0), DecoderVariant(4, 1, "storage", 0), DecoderVariant(2, 16, "storage", 1)


def decoded(
    graphics: GraphicsContext, codec: GridConfig, precision: Precision, variant: DecoderVariant
) -> list[NDArray[np.float32]]:
    """Albedo of three textures with one decoder: by index, by the shared variant, binned. Halves are emulated."""
    pack = square_pack(3, 1, 16, codec)
    visibility = VisibilityTarget(graphics, SIZE, SurfaceContent(False, False))
    visibility.write(interleaved_words(SIZE, 3))
    library = ShaderLibrary(shaders_folder(), scene_includes())
    programs = codec_programs(ProgramFactory(graphics.gl, library), pack, variant)
    buffers = PackBuffers(graphics, pack, range(3), precision, True, variant)
    ranges = DecoderRanges(graphics, pack, precision, variant)
    material, target = (
        white_material(graphics),
        ColorTarget(graphics, SIZE),
    )
    inputs = VisibilityInputs(visibility, material, textures=(0, 1, 2))
    pictures = []
    for shared, with_ranges in ((None, None), (0, ranges)):
        DecodeDeferredPass(graphics, programs, buffers, with_ranges, PlaneReading(), shared).run(inputs, target)
        pictures.append(target.read())
    binned = DecodeBinnedPass(graphics, programs, buffers, ranges, PlaneReading())
    binned.run(inputs, target)
    pictures.append(target.read())
    for made in (target, material, binned, ranges, buffers, programs):
        made.release()
    return pictures


@pytest.mark.once
@pytest.mark.driver
@pytest.mark.parametrize(("codec", "precision"), [(PLAIN, "fp32"), (ADAPTED, "fp16")], ids=["plain", "adapted"])
def test_variants_give_the_same_numbers(graphics: GraphicsContext, codec: GridConfig, precision: Precision) -> None:
    expected = decoded(graphics, codec, precision, SOFTWARE)[0]
    assert expected.std() > 0.01
    for variant in OTHERS:
        for picture in decoded(graphics, codec, precision, variant):
            np.testing.assert_allclose(picture, expected, atol=1e-6, rtol=0.0, err_msg=str(variant))


@pytest.mark.parametrize("precision", ["fp16-arithmetic", "fp16-accumulate"])
def test_variants_compute_alike_in_halves(graphics: GraphicsContext, precision: Precision) -> None:
    expected = decoded(graphics, LEAST, precision, SOFTWARE)[0]
    for picture in decoded(graphics, LEAST, precision, DecoderVariant(2, 16, "uniforms", 1)):
        np.testing.assert_allclose(picture, expected, atol=1e-6, rtol=0.0)


def test_a_decoder_beyond_uniform_buffers_is_read_from_storage(graphics: GraphicsContext) -> None:
    small = replace(graphics, features=replace(graphics.features, uniform_block_bytes=64))
    expected = decoded(graphics, PLAIN, "fp32", SOFTWARE)[0]
    ranges = DecoderRanges(small, square_pack(3, 1, 16, PLAIN), "fp32", GPU)
    assert ranges.defines == {"DECODER_PLACE": 1}
    ranges.release()
    for picture in decoded(small, PLAIN, "fp32", GPU):
        np.testing.assert_allclose(picture, expected, atol=1e-6, rtol=0.0)
