"""The shaders' files with what Python tells them, in the GLSL of the driver at hand."""

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ShaderLibrary
from viewer.locations import shaders_folder
from viewer.render.resources.layout import scene_layout_glsl


def drawing_library(context: GraphicsContext) -> ShaderLibrary:
    """All shaders but those that need the layout of a codec (`codec_programs` adds that)."""
    generated = {"generated/layout.glsl": scene_layout_glsl()}
    return ShaderLibrary(shaders_folder(), generated, older=not context.features.compute)
