"""OpenGL contexts: without a window, or one that a window has made."""

from contextlib import suppress
from dataclasses import dataclass

import moderngl

from ntc.errors import InputError
from viewer.gl.allocation import GpuMemory, limit_from_environment
from viewer.gl.context_loss import ResetStatus, SimulatedLosses
from viewer.gl.devices import OLDEST_VERSION, device_number, is_software
from viewer.gl.features import COMPUTE_VERSION, DRAWING_VERSION, Features, find_features
from viewer.gl.functions import GlFunctions
from viewer.gl.limits import Limits
from viewer.gl.older_glsl import TextureBuffers
from viewer.gl.systems import SYSTEM, FunctionLoader, GraphicsSystem, make_context

LEAST = f"{DRAWING_VERSION // 100}.{DRAWING_VERSION // 10 % 10}"


@dataclass(frozen=True)
class ContextInformation:
    """Description of a context by its driver."""

    renderer: str
    vendor: str
    version: str

    @property
    def is_software(self) -> bool:
        """True where the renderer is known to run on the CPU."""
        return is_software(self.renderer)


@dataclass(frozen=True, eq=False)
class GraphicsContext:
    """Context of moderngl with all that modules of `viewer` need of it."""

    gl: moderngl.Context
    info: ContextInformation
    load: FunctionLoader
    """Loader of the addresses of OpenGL's functions."""
    functions: GlFunctions
    features: Features
    reset: ResetStatus
    """Status that tells whether the context is lost."""
    memory: GpuMemory
    """GPU allocator: all buffers, textures and framebuffers come from it."""
    texture_buffers: TextureBuffers
    """Stand-ins for storage buffers where `features` has no compute shaders."""
    waits: bool = True
    """True where frames wait for what they ask of the GPU, and so are always the same. Frames of a window go on, and take it later."""

    def bind_storage(self, buffer: moderngl.Buffer, binding: int) -> None:
        """Let shaders read a buffer by this storage binding."""
        if self.features.compute:
            buffer.bind_to_storage_buffer(binding)
        else:
            self.texture_buffers.bind(buffer, binding)

    def bind_read_image(self, texture: moderngl.Texture, unit: int) -> None:
        """Let shaders read a texture by this image unit."""
        if self.features.compute:
            texture.bind_to_image(unit, read=True, write=False)
        else:
            self.texture_buffers.bind_image(texture, unit)


def wrap_context(
    gl: moderngl.Context, load: FunctionLoader, losses: SimulatedLosses | None = None, waits: bool = True
) -> GraphicsContext:
    """Wrap a current moderngl context. Raises InputError where the driver lacks a required function.

    `waits` as in the GraphicsContext; `losses`: simulated losses of the context; None: those that the environment asks for.
    """
    reset = ResetStatus(load, SimulatedLosses.of_environment() if losses is None else losses)
    information = ContextInformation(gl.info["GL_RENDERER"], gl.info["GL_VENDOR"], gl.info["GL_VERSION"])
    try:
        functions = GlFunctions(load, gl.version_code >= COMPUTE_VERSION)
    except RuntimeError as error:
        raise InputError(f"{information.renderer}, OpenGL {information.version}: {error}; update the driver") from error
    features = find_features(gl, information.is_software)
    memory = GpuMemory(gl, limit_from_environment(), limits=Limits.of(gl.info, features.compute))
    buffers = TextureBuffers(functions)
    return GraphicsContext(gl, information, load, functions, features, reset, memory, buffers, waits)


def create_headless_context(device: str | None = None, system: GraphicsSystem = SYSTEM) -> GraphicsContext:
    """Create a context without a window, on the GPU that `device` names (None: `viewer.gl.devices.device_number`).

    Raises InputError where there is no such device, or no OpenGL 4.1 on it.
    """
    number = device_number(device, system)
    try:
        gl, load = _newest_context(number, system)
    except Exception as error:
        older = _older_context(number, system)
        if older is not None:
            raise InputError(
                f"OpenGL {LEAST} is required, the driver offers {older}; update it, or draw without the GPU: {system.software}"
            ) from error
        raise InputError(f"OpenGL {LEAST} without a window is not available ({error}); {system.driver}") from error
    return wrap_context(gl, load)


def _newest_context(device: int, system: GraphicsSystem) -> tuple[moderngl.Context, FunctionLoader]:
    # glcontext raises plain Exceptions.
    with suppress(Exception):
        return make_context(COMPUTE_VERSION, device, system)
    return make_context(DRAWING_VERSION, device, system)


def _older_context(device: int, system: GraphicsSystem) -> str | None:
    """Return version and renderer of the context that the device offers below DRAWING_VERSION; None where it offers none."""
    # glcontext raises plain Exceptions.
    with suppress(Exception):
        gl, _ = make_context(OLDEST_VERSION, device, system)
        description = f"{gl.info['GL_VERSION']} by {gl.info['GL_RENDERER']}"
        gl.release()
        return description
    return None
