"""GPUs of this machine, as EGL lists them, and the choice of the one that draws without a window."""

import ctypes
import ctypes.util
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from ntc.errors import InputError
from viewer.gl.systems import SYSTEM, GraphicsSystem, make_context

DEVICE_VARIABLE: Final = "NTC_VIEWER_DEVICE"
"""Environment variable that sets --device, for commands without the option as well."""
SOFTWARE_VARIABLE: Final = "LIBGL_ALWAYS_SOFTWARE"
"""Environment variable of Mesa for whatever opens a window; here it means SOFTWARE."""
SOFTWARE: Final = "software"
"""Choice of the first device that is no GPU."""
SOFTWARE_RENDERERS: Final = ("llvmpipe", "softpipe", "swr", "swiftshader")
OLDEST_VERSION: Final = 330
"""Version of OpenGL that is requested to examine a device."""
EGL_DRM_DEVICE_FILE: Final = 0x3233


def is_software(renderer: str) -> bool:
    """Return whether a renderer of this name is known to run on the CPU."""
    return any(name in renderer.lower() for name in SOFTWARE_RENDERERS)


@dataclass(frozen=True)
class Device:
    """Device of EGL's list."""

    index: int
    renderer: str
    """Name of the device in OpenGL, or the reason why it makes no context."""
    version: str
    """Versions of OpenGL and of the driver; empty where the device makes no context."""
    file: str
    """Device file, which tells apart GPUs of one kind; empty where EGL does not say."""

    @property
    def line(self) -> str:
        """Line that describes the device."""
        described = f"{self.renderer}, OpenGL {self.version}" if self.version else f"unusable ({self.renderer})"
        return f"{self.index}: {described}" + (f", {self.file}" if self.file else "")


def _device_files() -> tuple[str, ...]:
    """Return the file of each EGL device, or an empty name; none where EGL or its list is missing."""
    try:
        library = ctypes.CDLL(ctypes.util.find_library("EGL") or "libEGL.so.1")
    except OSError:
        return ()
    find: Any = library.eglGetProcAddress
    find.restype, find.argtypes = ctypes.c_void_p, [ctypes.c_char_p]
    query, name = find(b"eglQueryDevicesEXT"), find(b"eglQueryDeviceStringEXT")
    if not query or not name:
        return ()
    query_devices = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(query)
    count = ctypes.c_int()
    if not query_devices(0, None, ctypes.byref(count)) or count.value < 1:
        return ()
    devices = (ctypes.c_void_p * count.value)()
    if not query_devices(count.value, devices, ctypes.byref(count)):
        return ()
    device_string = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int)(name)
    return tuple((device_string(device, EGL_DRM_DEVICE_FILE) or b"").decode() for device in devices)


def _examined(index: int, file: str) -> Device:
    # glcontext raises plain Exceptions.
    try:
        gl, _ = make_context(OLDEST_VERSION, index)
    except Exception as error:  # noqa: BLE001
        return Device(index, str(error), "", file)
    device = Device(index, gl.info["GL_RENDERER"], gl.info["GL_VERSION"], file)
    gl.release()
    return device


def find_devices(system: GraphicsSystem = SYSTEM) -> tuple[Device, ...]:
    """Return all devices, each examined with a separate context; empty if the system offers no choice.

    No context is current afterwards.
    """
    return tuple(_examined(index, file) for index, file in enumerate(_device_files())) if system.has_egl else ()


def choose_device(choice: str, devices: Sequence[Device]) -> int:
    """Return the index of the device that `choice` names: by number, by part of its name or file, or SOFTWARE. Raises InputError."""
    there = "; ".join(device.line for device in devices) or "none"
    wanted = choice.strip().lower()
    matching = [device for device in devices if wanted == str(device.index)]
    if wanted == SOFTWARE:
        matching = [device for device in devices if device.version and is_software(device.renderer)]
    elif not matching and wanted:
        matching = [
            device for device in devices if device.version and wanted in f"{device.renderer} {device.file}".lower()
        ]
    if not matching:
        raise InputError(f"--device {choice}: no such device (available: {there})")
    if len(matching) > 1 and wanted != SOFTWARE:
        raise InputError(f"--device {choice}: matches several devices; choose one by its number ({there})")
    return matching[0].index


def _software_if_asked(system: GraphicsSystem) -> str | None:
    # Mesa refuses to start a GPU's device under this variable, and NVIDIA's driver does not know it.
    asked = os.environ.get(SOFTWARE_VARIABLE, "").lower() in ("1", "true", "yes", "y")
    return SOFTWARE if asked and system.has_egl and len(_device_files()) > 1 else None


def device_number(choice: str | None, system: GraphicsSystem = SYSTEM) -> int:
    """Return the index of the device that `choice` names, else the one of DEVICE_VARIABLE, else the first one.

    Raises InputError where it names none, and where the system offers no choice.
    """
    named = choice if choice is not None else os.environ.get(DEVICE_VARIABLE) or _software_if_asked(system)
    if not named:
        return 0
    if not system.has_egl:
        raise InputError(f"--device {named}: this system has no choice of the GPU by this option; {system.window_gpu}")
    return choose_device(named, find_devices(system))
