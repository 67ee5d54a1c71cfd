"""Each class of renderer has its variant of the decoding shaders, unless an option names one."""

from dataclasses import replace

import pytest

from ntc.codec.gpu import GPU, SOFTWARE
from viewer.gl.context import GraphicsContext
from viewer.render.resources.decoding_shaders import decoder_variant


@pytest.mark.computes
def test_each_class_of_renderer_has_its_variant(graphics: GraphicsContext) -> None:
    on_gpu = replace(graphics, info=replace(graphics.info, renderer="a GPU"))
    in_buffers = replace(graphics, features=replace(graphics.features, weights_in_image=False))
    assert decoder_variant(graphics) == decoder_variant(on_gpu, "software") == SOFTWARE
    assert decoder_variant(on_gpu) == decoder_variant(graphics, "gpu") == GPU
    assert decoder_variant(in_buffers) == replace(SOFTWARE, weights="uniforms")


def test_opengl_4_1_reads_weights_as_a_texture(graphics: GraphicsContext) -> None:
    old = replace(graphics, features=replace(graphics.features, compute=False, weights_in_image=True))
    assert decoder_variant(replace(old, info=replace(old.info, renderer="a GPU"))) == SOFTWARE
    assert decoder_variant(old, "gpu") == replace(GPU, weights="image")
