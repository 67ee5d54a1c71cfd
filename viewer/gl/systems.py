"""Differences between operating systems: how a context is made without a window, and what to advise where none can be made."""

import os
import sys
from collections.abc import Callable, MutableMapping
from dataclasses import dataclass
from typing import Any, Final

import glcontext
import moderngl

from viewer.gl.triton_guard import refuse_triton

FunctionLoader = Callable[[str], int]
"""Function: name of an OpenGL function -> its address, 0 if there is none."""
NO_ADDRESS: Final = frozenset({1, 2, 3, (1 << 64) - 1})
"""Values that wglGetProcAddress of some drivers returns, besides 0, for a function that they lack."""
DRIVER_SETTINGS: Final = {"ZINK_DESCRIPTORS": "lazy"}
"""Environment variables that drivers read. zink of Mesa 25.0 and 26.2, left to choose, computes wrong results from the second frame on
that no wait divides from the first (docs/explanation/decode-paths.md)."""


@dataclass(frozen=True)
class GraphicsSystem:
    """Facts about OpenGL on one operating system."""

    name: str
    has_egl: bool
    """True where contexts without a window come from EGL, which lists the machine's GPUs; elsewhere from the window system."""
    driver: str
    """Advice on what to install where there is no context without a window."""
    window: str
    """Advice on what to check where no window opens."""
    software: str
    """Advice on how to draw without a GPU."""
    window_gpu: str
    """Advice on how to choose the GPU of a window, and of everything where there is no EGL."""


LINUX: Final = GraphicsSystem(
    "Linux",
    True,
    "install EGL and a driver, on Debian: apt-get install libegl1 libgl1 libgl1-mesa-dri",
    "check DISPLAY and the OpenGL driver",
    "LIBGL_ALWAYS_SOFTWARE=1 (Mesa's llvmpipe)",
    "on Linux the environment does: DRI_PRIME=1 (Mesa), or __NV_PRIME_RENDER_OFFLOAD=1 __GLX_VENDOR_LIBRARY_NAME=nvidia (NVIDIA)",
)
WINDOWS: Final = GraphicsSystem(
    "Windows",
    False,
    "install the driver of the GPU's maker: what Windows brings by itself, and gives remote sessions, ends at OpenGL 1.1",
    "install the driver of the GPU's maker",
    "Mesa's opengl32.dll and the files that come with it, beside python.exe, or named by GLCONTEXT_WIN_LIBGL",
    "on Windows the system does, by program: Settings > System > Display > Graphics > python.exe > High performance",
)
MACOS: Final = GraphicsSystem(
    "macOS",
    False,
    "macOS brings its own driver, with OpenGL 4.1, which needs a session with a screen",
    "start it from a session with a screen",
    "macOS has no driver without a GPU for this",
    "on macOS the system does: System Settings > Battery > Automatic graphics switching",
)


def system_of(platform: str) -> GraphicsSystem:
    """Return the system that `sys.platform` names; every other Unix is as Linux."""
    return {"win32": WINDOWS, "cygwin": WINDOWS, "darwin": MACOS}.get(platform, LINUX)


SYSTEM: Final = system_of(sys.platform)


def set_up_drivers(environment: MutableMapping[str, str] = os.environ) -> None:
    """Set DRIVER_SETTINGS where the user has not, and keep triton out of the process: to be called before a context is made."""
    refuse_triton()
    for name, value in DRIVER_SETTINGS.items():
        environment.setdefault(name, value)


def make_context(
    version: int, device: int = 0, system: GraphicsSystem = SYSTEM
) -> tuple[moderngl.Context, FunctionLoader]:
    """Make a context without a window, current, of at least `version` (430 is 4.3); return it and the addresses of its functions.

    `device`: number of the GPU in EGL's list; only 0 where the system has no EGL. Raises whatever moderngl and glcontext raise, plain
    Exception included.
    """
    set_up_drivers()
    back_end = glcontext.get_backend_by_name("egl") if system.has_egl else glcontext.default_backend()
    made: Any = back_end(mode="standalone", glversion=version, device_index=device)
    gl = moderngl.create_context(require=version, standalone=True, context=made)

    def load(name: str) -> int:
        # The address comes from EGL, from wglGetProcAddress and opengl32.dll, or from macOS's framework.
        address = int(made.load(name))
        return 0 if address in NO_ADDRESS else address

    return gl, load
