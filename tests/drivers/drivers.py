"""Which drivers of OpenGL there are on this machine to test with, and how Python is started with each."""

import json
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

FOLDER_VARIABLE: Final = "NTC_VIEWER_TEST_MESA"
"""Environment variable: folder that `tests/drivers/newer_mesa.py` has made."""
ROOT: Final = Path(__file__).resolve().parents[2]
DEFAULT_FOLDER: Final = ROOT / ".mesa"
ZINK: Final = {
    "MESA_LOADER_DRIVER_OVERRIDE": "zink",
    "GALLIUM_DRIVER": "zink",
    "LIBGL_ALWAYS_SOFTWARE": "1",
    "LIBGL_KOPPER_DISABLE": "1",
}
"""OpenGL by way of Vulkan, and that by lavapipe."""
NATIVE_HALVES: Final = {"MESA_EXTENSION_OVERRIDE": "+GL_AMD_gpu_shader_half_float"}
"""llvmpipe computes in halves of its own since Mesa 25, but does not tell."""
OLDER_VERSION: Final = {"MESA_GL_VERSION_OVERRIDE": "4.1"}
"""Mesa offers no more than macOS does."""
SYSTEM_VULKAN: Final = Path("/usr/share/vulkan/icd.d")
PROBE: Final = """
import json
from viewer.gl.context import create_headless_context
context = create_headless_context()
print(json.dumps([context.info.renderer, context.info.version]))
"""


@dataclass(frozen=True)
class Driver:
    """A way to start Python such that it draws with another driver than the system's."""

    name: str
    python: Path
    environment: Mapping[str, str]
    sign: str
    """Part of its description, in lower case, by which it is known to be in use."""
    tests: tuple[str, ...] = ("tests/gl", "tests/golden", "tests/drivers")
    """What is tested with it."""

    def run(
        self, *arguments: str, quiet: bool = False, variables: Mapping[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        """Run Python in the repository with this driver, and with further `variables` of the environment."""
        environment = {**os.environ, **self.environment, **(variables or {})}
        command = [str(self.python), *arguments]
        return subprocess.run(command, cwd=ROOT, env=environment, capture_output=quiet, text=True, check=False)

    def description(self) -> str | None:
        """Renderer and version as the driver tells them, or None where it cannot be used."""
        found = self.run("-c", PROBE, quiet=True)
        if found.returncode != 0:
            return None
        renderer, version = json.loads(found.stdout.splitlines()[-1])
        text = f"{renderer}, OpenGL {version}"
        return text if self.sign in text.lower() else None


SYSTEM: Final = Driver("the system's", Path(sys.executable), {}, "")


def mesa_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Where a newer Mesa lies, if there is one."""
    return Path(environment.get(FOLDER_VARIABLE) or DEFAULT_FOLDER).absolute()


def write_python(folder: Path) -> Path:
    """A command in `folder` that starts this Python, with its environment, with the libraries and drivers of that suite.

    It is a Python of its own to `sys.executable`, so that the processes it starts draw with the same driver. Raises OSError.
    """
    linker = next(folder.glob("usr/lib/*/ld-linux*.so.*"))
    libraries, base = linker.parent, Path(os.path.realpath(sys.executable))
    command = folder / "bin" / "python"
    variables = {
        "__EGL_VENDOR_LIBRARY_FILENAMES": folder / "usr/share/glvnd/egl_vendor.d/50_mesa.json",
        "LIBGL_DRIVERS_PATH": libraries / "dri",
        "GBM_BACKENDS_PATH": libraries / "gbm",
        # Mesas of different age that share a cache may end one another (SIGBUS).
        "MESA_SHADER_CACHE_DIR": folder / "shader-cache",
        "VK_DRIVER_FILES": next(folder.glob("usr/share/vulkan/icd.d/lvp_icd*.json")),
    }
    paths = f"{libraries}:/usr/lib/{libraries.name}"
    lines = [
        "#!/bin/sh",
        *(f"export {name}={shlex.quote(str(value))}" for name, value in variables.items()),
        f'exec {shlex.join([str(linker), "--argv0", str(command), "--library-path", paths, str(base)])} "$@"',
    ]
    command.parent.mkdir(exist_ok=True)
    command.write_text("\n".join(lines) + "\n", encoding="utf-8")
    command.chmod(0o755)
    # What makes a folder a virtual environment: packages are those of the environment at hand.
    has_own = sys.prefix != sys.base_prefix
    settings = f"home = {base.parent}\ninclude-system-site-packages = {str(not has_own).lower()}\n"
    (folder / "pyvenv.cfg").write_text(settings, encoding="utf-8")
    link = folder / "lib"
    link.unlink(missing_ok=True)
    link.symlink_to(Path(sys.prefix) / "lib" if has_own else libraries)
    return command


def other_drivers() -> Iterator[tuple[Driver | None, str]]:
    """Drivers besides the system's: each with the description that it gives, or None with what would make it usable."""
    older = Driver("OpenGL 4.1", SYSTEM.python, OLDER_VERSION, "opengl 4.1", ("tests/gl", "tests/drivers"))
    folder = mesa_folder()
    try:
        newer = write_python(folder)
    except (OSError, StopIteration):
        yield None, f"newer llvmpipe: python3 -m tests.drivers.newer_mesa {folder}"
        vulkan = next(SYSTEM_VULKAN.glob("lvp_icd*.json"), None)
        environment = {**ZINK, "VK_ICD_FILENAMES": str(vulkan)}
        candidates = [Driver("zink", SYSTEM.python, environment, "zink")]
    else:
        candidates = [Driver("newer llvmpipe", newer, NATIVE_HALVES, "llvmpipe"), Driver("zink", newer, ZINK, "zink")]
    for driver in (*candidates, older):
        description = driver.description()
        if description is None and driver is older:
            yield None, f"{driver.name}: the system's driver is not Mesa's, or is older"
        elif description is None:
            yield None, f"{driver.name}: apt-get install mesa-vulkan-drivers, or make a newer Mesa's folder"
        else:
            yield driver, description
