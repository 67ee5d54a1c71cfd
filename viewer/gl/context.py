"""OpenGL contexts: headless under EGL, or one that a window has made."""

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
"""Asked for to say what is there."""
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
    features: Features
    reset: ResetStatus
    """Whether it is lost."""
    memory: GpuMemory
    """Whom to ask for buffers and textures."""


def wrap_context(gl: moderngl.Context, load: FunctionLoader, losses: SimulatedLosses | None = None) -> GraphicsContext:
    """A GraphicsContext around a current moderngl context. Raises InputError where it lacks something that is needed.

    `losses` None: those that the environment asks for.
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
    """A context without a window. Raises InputError where EGL or OpenGL 4.3 are not to be had."""
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
    """Version and renderer of what the machine offers below what is needed; None for nothing at all."""
    try:
        settings: Any = {"backend": "egl"}
        gl = moderngl.create_standalone_context(require=OLDEST_VERSION, **settings)
    except Exception:
        return None
    found = f"{gl.info['GL_VERSION']} by {gl.info['GL_RENDERER']}"
    gl.release()
    return found
