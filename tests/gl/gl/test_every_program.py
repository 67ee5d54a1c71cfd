"""Another compiler than the driver's accepts every program that can be assembled."""

import re
import shutil
import subprocess
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from tests.support.every_program import AssembledProgram
from viewer.export.web.packed import SHADER
from viewer.gl.older_glsl import OlderSource, older_source
from viewer.locations import shaders_folder

pytestmark = pytest.mark.once
FILES_AT_ONCE = 200
UNITS_OF_A_STAGE, UNITS = 16, 80
"""Texture units that OpenGL 4.1 guarantees (GL_MAX_TEXTURE_IMAGE_UNITS, GL_MAX_COMBINED_TEXTURE_IMAGE_UNITS)."""
SAMPLER = re.compile(r"^\s*uniform [iu]?sampler\w+ (\w+);", re.MULTILINE)


def test_every_shader_file_is_in_some_program(programs: tuple[AssembledProgram, ...]) -> None:
    shaders = {
        str(path.relative_to(shaders_folder())) for path in shaders_folder().rglob("*.*") if path.suffix != ".glsl"
    }
    # Browsers compile what pages decode with (tests/end_to_end/export/test_page.py).
    assert shaders - {SHADER} == {name for program in programs for name in program.files}


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


def drawing_in_glsl_4_10(
    programs: tuple[AssembledProgram, ...],
) -> Iterator[tuple[AssembledProgram, list[OlderSource]]]:
    """What draws where nothing computes: each program with its vertex and its fragment shader in GLSL 4.10."""
    for program in programs:
        if (
            len(program.files) == 2
            and program.texts[0].startswith("#version 430")
            and program.defines.get("WEIGHTS_IN_IMAGE", 1)
            and not program.defines.get("HALF_ARITHMETIC", 0)
        ):
            yield program, [older_source(text) for text in program.texts]


def test_glslang_accepts_in_glsl_4_10_what_draws(programs: tuple[AssembledProgram, ...], tmp_path: Path) -> None:
    texts = {
        shader.text: name
        for program, shaders in drawing_in_glsl_4_10(programs)
        for name, shader in zip(program.files, shaders, strict=True)
    }
    assert all(text.startswith("#version 410\n") for text in texts)
    found = complaints(texts, tmp_path)
    assert not found, "\n".join(found[:20])


def test_glsl_4_10_needs_no_more_texture_units_than_are_guaranteed(programs: tuple[AssembledProgram, ...]) -> None:
    """Texture buffers stand in for storage buffers, and count among the samplers."""
    most = 0
    for program, shaders in drawing_in_glsl_4_10(programs):
        for name, shader in zip(program.files, shaders, strict=True):
            assert set(shader.units) == set(SAMPLER.findall(shader.text)), name
            assert len(shader.units) <= UNITS_OF_A_STAGE, (name, sorted(shader.units))
        both = [unit for shader in shaders for unit in shader.units.values()]
        assert len(both) <= UNITS, program.files
        assert max(both, default=0) < UNITS, program.files
        most = max(most, len(both))
    assert most > UNITS_OF_A_STAGE // 2, "texture buffers are among them"


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
