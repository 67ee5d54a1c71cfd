"""How the network is laid out changes no number: where weights lie, and how many pixels an invocation decodes."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.fixture import interleaved_words, white_material
from lab.bench.random_pack import square_pack
from ntc.codec.gpu import SOFTWARE, DecoderVariant
from ntc.codec.grid.model import GridConfig
from ntc.errors import InputError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, ShaderLibrary
from viewer.locations import shaders_folder
from viewer.render.passes.decode import DecodeBinnedPass, DecodeDeferredPass
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.decoding_shaders import CANDIDATES, parsed_variant
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
ODD = DecoderVariant(3, 2, "image", 7), DecoderVariant(4, 1, "storage"), DecoderVariant(3, 2, "shared", 7)


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
    for variant in (*CANDIDATES, *ODD):
        for picture in decoded(graphics, codec, precision, variant):
            np.testing.assert_allclose(picture, expected, atol=1e-6, rtol=0.0, err_msg=str(variant))


@pytest.mark.parametrize("precision", ["fp16-arithmetic", "fp16-accumulate"])
def test_variants_compute_alike_in_halves(graphics: GraphicsContext, precision: Precision) -> None:
    expected = decoded(graphics, LEAST, precision, SOFTWARE)[0]
    for picture in decoded(graphics, LEAST, precision, CANDIDATES[3]):
        np.testing.assert_allclose(picture, expected, atol=1e-6, rtol=0.0)


def test_a_decoder_beyond_shared_memory_and_uniform_buffers_is_read_from_storage(graphics: GraphicsContext) -> None:
    small = replace(graphics, features=replace(graphics.features, uniform_block_bytes=64))
    expected = decoded(graphics, PLAIN, "fp32", SOFTWARE)[0]
    for context, codec in ((small, PLAIN), (graphics, GridConfig(hidden_width=92, positional_octaves=1))):
        wanted = expected if codec is PLAIN else decoded(context, codec, "fp32", SOFTWARE)[0]
        variant = DecoderVariant(1, 1, "uniforms" if codec is PLAIN else "shared")
        ranges = DecoderRanges(context, square_pack(3, 1, 16, codec), "fp32", variant)
        assert ranges.defines == {"DECODER_PLACE": 1}
        ranges.release()
        for picture in decoded(context, codec, "fp32", variant):
            np.testing.assert_allclose(picture, wanted, atol=1e-6, rtol=0.0)


@pytest.mark.parametrize(
    "text", ["pixels=0", "pixels=33", "chunk=0", "unrolled=17", "weights=disk", "pixels=many", "colour=1"]
)
def test_settings_out_of_range_are_refused(text: str) -> None:
    with pytest.raises(InputError, match=text.partition("=")[0]):
        parsed_variant(text)


def test_a_variant_is_read_as_it_is_written() -> None:
    for variant in CANDIDATES:
        assert parsed_variant(str(variant)) == variant
