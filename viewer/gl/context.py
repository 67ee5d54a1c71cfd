"""OpenGL contexts: headless under EGL, or one that a window has made."""

from dataclasses import dataclass
from typing import Any

import moderngl

from ntc.errors import InputError
from viewer.gl.functions import FunctionLoader, GlFunctions, egl_loader

REQUIRED_VERSION = 430
SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swr", "swiftshader")


@dataclass(frozen=True)
class ContextInformation:
    """Who draws."""

    renderer: str
    vendor: str
    version: str

    @property
    def is_software(self) -> bool:
        """Whether the renderer is known to run on the CPU."""
        return any(name in self.renderer.lower() for name in SOFTWARE_RENDERERS)


@dataclass(frozen=True, eq=False)
class GraphicsContext:
    """A moderngl context, what it is, and the functions that moderngl lacks."""

    gl: moderngl.Context
    info: ContextInformation
    functions: GlFunctions


def wrap_context(gl: moderngl.Context, load: FunctionLoader) -> GraphicsContext:
    """A GraphicsContext around a current moderngl context."""
    information = ContextInformation(gl.info["GL_RENDERER"], gl.info["GL_VENDOR"], gl.info["GL_VERSION"])
    return GraphicsContext(gl, information, GlFunctions(load))


def create_headless_context() -> GraphicsContext:
    """A context without a window. Raises InputError where EGL or OpenGL 4.3 are not to be had."""
    try:
        settings: Any = {"backend": "egl"}
        gl = moderngl.create_standalone_context(require=REQUIRED_VERSION, **settings)
        return wrap_context(gl, egl_loader())
    except Exception as error:
        raise InputError(
            f"OpenGL 4.3 without a window is not available ({error}); install EGL and a driver, "
            "on Debian: apt-get install libegl1 libgl1 libgl1-mesa-dri"
        ) from error
