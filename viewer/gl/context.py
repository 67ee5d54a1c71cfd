"""OpenGL contexts: headless under EGL, or one that a window has made."""

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import moderngl

from ntc.errors import InputError
from viewer.gl.allocation import GpuMemory, limit_from_environment
from viewer.gl.context_loss import ResetStatus, SimulatedLosses
from viewer.gl.features import Features, find_features
from viewer.gl.functions import FunctionLoader, GlFunctions, egl_loader

REQUIRED_VERSION = 430
VERSION = f"{REQUIRED_VERSION // 100}.{REQUIRED_VERSION // 10 % 10}"
OLDEST_VERSION = 330
"""Requested to name the version that the machine has, where REQUIRED_VERSION is missing."""
SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swr", "swiftshader")


@dataclass(frozen=True)
class ContextInformation:
    """The driver's own description of a context."""

    renderer: str
    vendor: str
    version: str

    @property
    def is_software(self) -> bool:
        """Whether the renderer is known to run on the CPU."""
        return any(name in self.renderer.lower() for name in SOFTWARE_RENDERERS)


@dataclass(frozen=True, eq=False)
class GraphicsContext:
    """A moderngl context with all that modules of `viewer` need of it."""

    gl: moderngl.Context
    info: ContextInformation
    functions: GlFunctions
    features: Features
    reset: ResetStatus
    """Tells whether the context is lost."""
    memory: GpuMemory
    """GPU allocator: all buffers, textures and framebuffers come from it."""


def wrap_context(gl: moderngl.Context, load: FunctionLoader, losses: SimulatedLosses | None = None) -> GraphicsContext:
    """A GraphicsContext around a current moderngl context. Raises InputError where the driver lacks a required function.

    `losses`: simulated losses of the context; None: those that the environment asks for.
    """
    reset = ResetStatus(load, SimulatedLosses.of_environment() if losses is None else losses)
    information = ContextInformation(gl.info["GL_RENDERER"], gl.info["GL_VENDOR"], gl.info["GL_VERSION"])
    try:
        functions = GlFunctions(load)
    except RuntimeError as error:
        raise InputError(f"{information.renderer}, OpenGL {information.version}: {error}; update the driver") from error
    features = find_features(gl, information.is_software)
    memory = GpuMemory(gl, limit_from_environment())
    return GraphicsContext(gl, information, functions, features, reset, memory)


def create_headless_context() -> GraphicsContext:
    """A context without a window. Raises InputError where EGL or OpenGL 4.3 is not available."""
    try:
        settings: Any = {"backend": "egl"}
        gl = moderngl.create_standalone_context(require=REQUIRED_VERSION, **settings)
    except Exception as error:
        older = _older_context()
        if older is not None:
            raise InputError(
                f"OpenGL {VERSION} is needed, and {older} is there; update the driver, or use Mesa's llvmpipe: "
                "LIBGL_ALWAYS_SOFTWARE=1"
            ) from error
        raise InputError(
            f"OpenGL {VERSION} without a window is not available ({error}); install EGL and a driver, "
            "on Debian: apt-get install libegl1 libgl1 libgl1-mesa-dri"
        ) from error
    return wrap_context(gl, egl_loader())


def _older_context() -> str | None:
    """Version and renderer of the context that the machine offers below REQUIRED_VERSION; None where it offers none."""
    # glcontext raises plain Exceptions.
    with suppress(Exception):
        settings: Any = {"backend": "egl"}
        gl = moderngl.create_standalone_context(require=OLDEST_VERSION, **settings)
        found = f"{gl.info['GL_VERSION']} by {gl.info['GL_RENDERER']}"
        gl.release()
        return found
    return None
