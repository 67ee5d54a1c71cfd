"""Compiles OpenGL programs with a Vulkan driver that needs no GPU: glslang makes SPIR-V of them, RADV's null device machine code."""

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
"""Environment variable: folder with a Mesa of its own (tests/drivers/newer_mesa.py)."""
DEFAULT_FOLDER: Final = Path(__file__).resolve().parents[3] / ".mesa"
SYSTEM: Final = Path("/")
DRIVERS: Final = "usr/share/vulkan/icd.d"
GLSLANG: Final = "glslangValidator"
# Vulkan's rules, relaxed: uniforms outside of blocks become a block. In OpenGL each kind of binding has numbers of its own, which
# Vulkan has not: they are shifted apart (null_device.py).
OPTIONS: Final = ["-V", "-R", "--aml", "--amb"]
SHIFTS: Final = {"ssbo": 0, "image": 16, "texture": 32, "ubo": 64}
INSTALL: Final = "apt-get install glslang-tools mesa-vulkan-drivers, or python3 -m tests.drivers.newer_mesa .mesa"


@dataclass(frozen=True)
class Compiler:
    """RADV, and the family of GPUs that it compiles for."""

    root: Path
    """Folder of the system that the driver belongs to."""
    driver: Path
    family: str
    """As RADV_FORCE_FAMILY has it."""

    def _command(self) -> list[str]:
        """How Python is started with the driver's own C library."""
        python = os.path.realpath(sys.executable)
        if self.root == SYSTEM:
            return [python]
        linker = next(self.root.glob("usr/lib/*/ld-linux*.so.*"))
        libraries = f"{linker.parent}:/usr/lib/{linker.parent.name}"
        return [str(linker), "--library-path", libraries, python]

    def run(self, programs: Sequence[Mapping[str, str]]) -> list[dict[str, Any]]:
        """What null_device.py answers for SPIR-V files. Raises InputError where the driver cannot be used."""
        script = Path(__file__).with_name("null_device.py")
        command = [*self._command(), str(script), str(self.driver)]
        environment = {**os.environ, "RADV_FORCE_FAMILY": self.family, "MESA_SHADER_CACHE_DISABLE": "true"}
        found = subprocess.run(
            command, input=json.dumps(programs), capture_output=True, text=True, env=environment, check=False
        )
        if found.returncode != 0:
            reason = (found.stderr.splitlines() or [f"it ended with {found.returncode}"])[-1]
            raise InputError(
                f"{self.driver}: cannot compile for {self.family}: {reason}; needs RADV of Mesa 23.2 or newer"
            )
        answers: list[dict[str, Any]] = json.loads(found.stdout)
        return answers


def find_compiler(family: str, environment: Mapping[str, str] = os.environ) -> Compiler:
    """RADV of the folder that MESA_VARIABLE names, of DEFAULT_FOLDER or of the system. Raises InputError where there is none."""
    if shutil.which(GLSLANG) is None:
        raise InputError(f"there is no {GLSLANG}: {INSTALL}")
    given = environment.get(MESA_VARIABLE)
    for root in (Path(given).absolute() if given else DEFAULT_FOLDER, SYSTEM):
        if any((root / DRIVERS).glob("radeon_icd*.json")):
            driver = next(root.glob("usr/lib/*/libvulkan_radeon.so"), None)
            if driver is not None:
                compiler = Compiler(root, driver, family)
                compiler.run([])
                return compiler
    raise InputError(f"there is no Vulkan driver for AMD: {INSTALL}")


def spirv(program: AssembledProgram, folder: Path) -> dict[str, str]:
    """Files in the empty `folder` with the program's stages, by the name of the stage. Raises InputError where glslang refuses it."""
    sources = [folder / f"stage{Path(name).suffix}" for name in program.files]
    for path, text in zip(sources, program.texts, strict=True):
        path.write_text(text, encoding="utf-8")
    shifts = [part for kind, first in SHIFTS.items() for part in (f"--shift-{kind}-binding", str(first))]
    command = [GLSLANG, "-l", *OPTIONS, *shifts, *(path.name for path in sources)]
    found = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    stages = [path.suffix[1:] for path in sources]
    if found.returncode != 0:
        raise InputError(f"{program.files[-1]}: {found.stdout.strip()}")
    return {stage: str(folder / f"{stage}.spv") for stage in stages}


def compiled(compiler: Compiler, programs: Sequence[AssembledProgram]) -> list[dict[str, Any]]:
    """What the driver tells of each program's last stage (null_device.py). Raises InputError where one cannot be compiled."""
    with tempfile.TemporaryDirectory() as place:
        files = list[dict[str, str]]()
        for number, program in enumerate(programs):
            folder = Path(place) / str(number)
            folder.mkdir()
            files.append(spirv(program, folder))
        answers = compiler.run(files)
    for program, answer in zip(programs, answers, strict=True):
        if "error" in answer:
            raise InputError(f"{program.files[-1]}, {dict(program.defines)}: {answer['error']}")
    return answers
