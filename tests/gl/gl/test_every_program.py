"""Another compiler than the driver's accepts every program that can be assembled."""

import shutil
import subprocess
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.support.every_program import AssembledProgram
from viewer.gl.older_glsl import older_source
from viewer.locations import shaders_folder

pytestmark = pytest.mark.once
FILES_AT_ONCE = 200


def test_every_shader_file_is_in_some_program(programs: tuple[AssembledProgram, ...]) -> None:
    shaders = {
        str(path.relative_to(shaders_folder())) for path in shaders_folder().rglob("*.*") if path.suffix != ".glsl"
    }
    assert shaders == {name for program in programs for name in program.files}


def test_programs_are_of_all_precisions(programs: tuple[AssembledProgram, ...]) -> None:
    kinds = Counter(
        (program.defines.get("HALF_ARITHMETIC", 0), program.defines.get("HALF_EMULATED", 0))
        for program in programs
        if "decode_deferred" in program.files[0]
    )
    assert set(kinds) == {(0, 0), (1, 0), (1, 1), (2, 0), (2, 1)}


def test_glslang_accepts_every_program(programs: tuple[AssembledProgram, ...], tmp_path: Path) -> None:
    texts = {text: name for program in programs for name, text in zip(program.files, program.texts, strict=True)}
    found = complaints(texts, tmp_path)
    assert not found, "\n".join(found[:20])


def test_glslang_accepts_in_glsl_4_10_what_draws(programs: tuple[AssembledProgram, ...], tmp_path: Path) -> None:
    texts = {
        older_source(text).text: name
        for program in programs
        if len(program.files) == 2
        and program.texts[0].startswith("#version 430")
        and program.defines.get("WEIGHTS_IN_IMAGE", 1)
        and not program.defines.get("HALF_ARITHMETIC", 0)
        for name, text in zip(program.files, program.texts, strict=True)
    }
    assert all(text.startswith("#version 410\n") for text in texts)
    found = complaints(texts, tmp_path)
    assert not found, "\n".join(found[:20])


def complaints(texts: Mapping[str, str], folder: Path) -> list[str]:
    """Errors and warnings of glslang in shaders, given with the names of their files."""
    compiler = shutil.which("glslangValidator")
    if compiler is None:
        pytest.skip("there is no glslangValidator: apt-get install glslang-tools")
    files = dict[str, str]()
    for number, (text, name) in enumerate(texts.items()):
        path = folder / f"{number}{Path(name).suffix}"
        path.write_text(text, encoding="utf-8")
        files[str(path)] = name
    found, paths, name = list[str](), list(files), ""
    for first in range(0, len(paths), FILES_AT_ONCE):
        command = [compiler, *paths[first : first + FILES_AT_ONCE]]
        # A line with each file's path, then what is wrong with it.
        for line in subprocess.run(command, capture_output=True, text=True, check=False).stdout.splitlines():
            name = files.get(line, name)
            found += [f"{name}: {line}"] if line.startswith(("ERROR", "WARNING")) else []
    return found
