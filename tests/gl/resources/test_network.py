"""How the network is laid out changes no number: where weights lie, and how many pixels an invocation decodes."""

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.fixture import interleaved_words, white_material
from lab.bench.random_pack import square_pack
from ntc.codec.config import CodecConfig
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, ShaderLibrary
from viewer.locations import shaders_folder
from viewer.render.passes.decode_binned import DecodeBinnedPass
from viewer.render.passes.decode_deferred import DecodeDeferredPass
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.decoder_ranges import DecoderRanges
from viewer.render.resources.layout import scene_layout_glsl
from viewer.render.resources.network import DEFAULT_NETWORK, NetworkConfig
from viewer.render.resources.pack_buffers import PackBuffers, codec_programs
from viewer.render.resources.visibility_buffer import PlaneReading, SurfaceContent, VisibilityInputs, VisibilityTarget
from viewer.state.view_state import Precision

SIZE = (37, 50)
PLAIN = CodecConfig(hidden_width=12, positional_octaves=1)
ADAPTED = CodecConfig(
    hidden_width=16, latent_channels=8, latent_bits=4, adapters=True, adapter_output=True, output_channels=4
)


def decoded(
    graphics: GraphicsContext, codec: CodecConfig, precision: Precision, network: NetworkConfig, in_image: bool
) -> list[NDArray[np.float32]]:
    """Albedo of three textures with one decoder: by index, by the shared variant, binned."""
    pack = square_pack(3, 1, 16, codec)
    visibility = VisibilityTarget(graphics, SIZE, SurfaceContent(False, False))
    visibility.write(interleaved_words(SIZE, 3))
    library = ShaderLibrary(shaders_folder(), {"generated/layout.glsl": scene_layout_glsl()})
    programs = codec_programs(ProgramFactory(graphics.gl, library), pack, network)
    buffers = PackBuffers(graphics, pack, range(3), precision, weights_in_image=in_image)
    ranges = DecoderRanges(graphics, pack, precision, network, weights_in_image=in_image)
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
@pytest.mark.parametrize("codec", [PLAIN, ADAPTED], ids=["plain", "adapted"])
@pytest.mark.parametrize("precision", ["fp32", "fp16"])
def test_layouts_give_the_same_numbers(graphics: GraphicsContext, codec: CodecConfig, precision: Precision) -> None:
    expected = decoded(graphics, codec, precision, DEFAULT_NETWORK, False)[0]
    assert expected.std() > 0.01
    networks = (DEFAULT_NETWORK, NetworkConfig(pixels=1, chunk=1), NetworkConfig(pixels=3, chunk=7, unrolled=2))
    for network, in_image in product(networks, (False, True)):
        for picture in decoded(graphics, codec, precision, network, in_image):
            np.testing.assert_allclose(picture, expected, atol=1e-6, rtol=0.0)


@pytest.mark.parametrize("wrong", [{"pixels": 0}, {"pixels": 33}, {"chunk": 0}, {"unrolled": 0}])
def test_settings_out_of_range_are_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        NetworkConfig(**wrong)
