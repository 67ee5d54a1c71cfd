"""Compilation of OpenGL programs with Mesa's Vulkan drivers, without a GPU: glslang makes SPIR-V, a driver makes machine code."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from lab.benchmarks.shaders.recording import AssembledProgram
from ntc.errors import InputError

MESA_VARIABLE: Final = "NTC_VIEWER_TEST_MESA"
"""Environment variable with the folder of another Mesa (tests/drivers/newer_mesa.py)."""
DEFAULT_FOLDER: Final = Path(__file__).resolve().parents[3] / ".mesa"
SYSTEM: Final = Path("/")
HERE: Final = Path(__file__).parent
GLSLANG: Final = "glslangValidator"
# Relaxed Vulkan rules turn uniforms outside blocks into a block. OpenGL numbers each kind of binding separately, Vulkan all together:
# therefore the kinds are shifted apart (null_device.py).
OPTIONS: Final = ["-V", "-R", "--aml", "--amb"]
SHIFTS: Final = {"ssbo": 0, "image": 16, "texture": 32, "ubo": 64}
INSTALL: Final = "apt-get install glslang-tools mesa-vulkan-drivers, or python3 -m tests.drivers.newer_mesa .mesa"


@dataclass(frozen=True)
class Gpu:
    """A GPU that is compiled for."""

    description: str
    library: str
    """File of Mesa's driver."""
    environment: Mapping[str, str]
    stand_in: bool = False
    """Whether the driver asks the kernel for the GPU, in whose place intel_stand_in.c answers."""


GPUS: Final = {
    "navi32": Gpu("AMD Navi32 (RX 7800 XT)", "libvulkan_radeon.so", {"RADV_FORCE_FAMILY": "navi32"}),
    "dg2": Gpu("Intel DG2 (Arc A770)", "libvulkan_intel.so", {}, stand_in=True),
}
"""By their short names."""


@dataclass(frozen=True)
class Compiler:
    """A driver, and the GPU that it compiles for."""

    root: Path
    """Folder of the system that the driver belongs to."""
    driver: Path
    gpu: Gpu

    def _command(self) -> list[str]:
        """Command that starts Python with the driver's C library."""
        python = os.path.realpath(sys.executable)
        if self.root == SYSTEM:
            return [python]
        linker = next(self.root.glob("usr/lib/*/ld-linux*.so.*"))
        libraries = f"{linker.parent}:/usr/lib/{linker.parent.name}"
        return [str(linker), "--library-path", libraries, python]

    def run(self, programs: Sequence[Mapping[str, str]]) -> list[dict[str, Any]]:
        """Return the answer of null_device.py for SPIR-V files. Raises InputError where the driver cannot be used."""
        command = [*self._command(), str(HERE / "null_device.py"), str(self.driver)]
        environment = {**os.environ, **self.gpu.environment, "MESA_SHADER_CACHE_DISABLE": "true"}
        with tempfile.TemporaryDirectory() as place:
            if self.gpu.stand_in:
                environment["LD_PRELOAD"] = str(built_stand_in(Path(place)))
            finished = subprocess.run(
                command, input=json.dumps(programs), capture_output=True, text=True, env=environment, check=False
            )
        if finished.returncode != 0:
            reason = (finished.stderr.splitlines() or [f"it ended with {finished.returncode}"])[-1]
            raise InputError(f"{self.driver}: no {self.gpu.description}: {reason}; needs Mesa 23.2 or newer: {INSTALL}")
        answers: list[dict[str, Any]] = json.loads(finished.stdout)
        return answers


def built_stand_in(folder: Path) -> Path:
    """The library of intel_stand_in.c, in `folder`. Raises InputError where it cannot be built."""
    library, source = folder / "stand_in.so", HERE / "intel_stand_in.c"
    compiler = shutil.which("cc")
    if compiler is None:
        raise InputError(
            "there is no C compiler, which the stand-in of Intel's kernel driver needs: apt-get install gcc libc6-dev"
        )
    command = [compiler, "-shared", "-fPIC", "-O1", "-o", str(library), str(source)]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    if finished.returncode != 0:
        raise InputError(f"{source.name}: {finished.stderr.strip()}")
    return library


def find_compiler(name: str, environment: Mapping[str, str] = os.environ) -> Compiler:
    """The driver for a GPU of GPUS, in the folder that MESA_VARIABLE names, in DEFAULT_FOLDER or in the system.

    Raises InputError where there is none.
    """
    gpu = GPUS[name]
    if shutil.which(GLSLANG) is None:
        raise InputError(f"there is no {GLSLANG}: {INSTALL}")
    given = environment.get(MESA_VARIABLE)
    for root in (Path(given).absolute() if given else DEFAULT_FOLDER, SYSTEM):
        driver = next(root.glob(f"usr/lib/*/{gpu.library}"), None)
        if driver is not None:
            compiler = Compiler(root, driver, gpu)
            compiler.run([])
            return compiler
    raise InputError(f"there is no Vulkan driver for {gpu.description}: {INSTALL}")


def spirv(program: AssembledProgram, folder: Path) -> dict[str, str]:
    """Files in the empty `folder` with the program's stages, by the name of the stage. Raises InputError where glslang refuses it."""
    sources = [folder / f"stage{Path(name).suffix}" for name in program.files]
    for path, text in zip(sources, program.texts, strict=True):
        path.write_text(text, encoding="utf-8")
    shifts = [part for kind, first in SHIFTS.items() for part in (f"--shift-{kind}-binding", str(first))]
    command = [GLSLANG, "-l", *OPTIONS, *shifts, *(path.name for path in sources)]
    finished = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    stages = [path.suffix[1:] for path in sources]
    if finished.returncode != 0:
        raise InputError(f"{program.files[-1]}: {finished.stdout.strip()}")
    return {stage: str(folder / f"{stage}.spv") for stage in stages}


def compiled(compiler: Compiler, programs: Sequence[AssembledProgram]) -> list[dict[str, Any]]:
    """Return the driver's statistics of the last stage of each program, or its error (null_device.py).

    Raises InputError where glslang refuses a program.
    """
    with tempfile.TemporaryDirectory() as place:
        files = list[dict[str, str]]()
        for number, program in enumerate(programs):
            folder = Path(place) / str(number)
            folder.mkdir()
            files.append(spirv(program, folder))
        return compiler.run(files)
