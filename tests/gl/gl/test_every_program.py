"""Every program that can be assembled is accepted by another compiler than the driver's, and keeps to what OpenGL guarantees.

Numbers are those of tables 23.55 to 23.64 of OpenGL 4.3, whatever the driver at hand offers beyond.
"""

import hashlib
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from ntc.codec.gpu import DecodingImage
from ntc.codec.maps import PLANES
from tests.drivers.messages import OWN_CACHE
from tests.support.declarations import Declaration, declarations
from tests.support.every_program import AssembledProgram, every_program
from viewer.gl.context import GraphicsContext
from viewer.gl.older_glsl import OlderSource, older_source
from viewer.lighting.prefilter import MOST_SAMPLES
from viewer.locations import shaders_folder
from viewer.render.resources.layout import (
    BIN_GROUP,
    GROUP_SIDE,
    MOST_LIGHTS,
    SCAN_GROUP,
    TEXEL_GROUP,
    ImageUnit,
    TextureUnit,
    UniformBinding,
)

pytestmark = pytest.mark.once
FILES_AT_ONCE = 200
ACCEPTED = OWN_CACHE / "accepted-by-glslang"
"""Hashes of accepted shaders, a line each; remove the file to compile all again."""
UNITS_OF_A_STAGE, UNITS = 16, 80
"""Texture units that OpenGL 4.1 guarantees (GL_MAX_TEXTURE_IMAGE_UNITS, GL_MAX_COMBINED_TEXTURE_IMAGE_UNITS)."""
SAMPLER = re.compile(r"^\s*uniform [iu]?sampler\w+ (\w+);", re.MULTILINE)
STORAGE_BUFFERS = 8
"""Binding points, blocks of a stage, and blocks of a program."""
IMAGES = 8
"""Units, and images of a program."""
OUTPUT_RESOURCES = 8
"""Storage blocks, images and outputs of a program together."""
SAMPLERS_OF_A_STAGE = 16
TEXTURE_UNITS = 96
UNIFORM_BINDINGS = 72
BLOCKS_OF_A_STAGE = 12
UNIFORM_BLOCK_BYTES = 16384
GROUP_INVOCATIONS = 1024

Stages = tuple[tuple[Declaration, ...], ...]


@pytest.fixture(scope="module", params=["sparse", pytest.param("all", marks=pytest.mark.guards("drawing"))])
def programs(graphics: GraphicsContext, request: pytest.FixtureRequest) -> tuple[AssembledProgram, ...]:
    """Every program that can be assembled; collecting them takes about 15 s, half of that for the sparse ones."""
    return every_program(graphics, request.param == "sparse")


def test_every_shader_file_is_in_some_program(programs: tuple[AssembledProgram, ...]) -> None:
    shaders = {
        str(path.relative_to(shaders_folder())) for path in shaders_folder().rglob("*.*") if path.suffix != ".glsl"
    }
    assert shaders == {name for program in programs for name in program.files}


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
    """Errors and warnings of glslang in shaders, given with the names of their files.

    Texts that this glslang has accepted in an earlier run are remembered by their hashes, and not compiled again.
    """
    compiler = shutil.which("glslangValidator")
    if compiler is None:
        pytest.skip("there is no glslangValidator: apt-get install glslang-tools")
    version = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True).stdout
    hashes = {text: hashlib.sha256(f"{version}{name}{text}".encode()).hexdigest() for text, name in texts.items()}
    accepted = set(ACCEPTED.read_text(encoding="ascii").split()) if ACCEPTED.is_file() else set[str]()
    files = dict[str, str]()
    for number, (text, name) in enumerate(texts.items()):
        if hashes[text] not in accepted:
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
    if not found:
        ACCEPTED.parent.mkdir(exist_ok=True)
        with ACCEPTED.open("a", encoding="ascii") as file:
            file.writelines(f"{own}\n" for own in hashes.values() if own not in accepted)
    return found


@pytest.fixture(scope="module")
def declared(programs: tuple[AssembledProgram, ...]) -> list[tuple[str, Stages]]:
    """Of each program its files, and what each of its stages declares."""
    of_text = {text: declarations(text) for program in programs for text in program.texts}
    return [(" + ".join(program.files), tuple(of_text[text] for text in program.texts)) for program in programs]


def numbers(stages: Stages, kind: str) -> list[int]:
    """Those of all stages; a block or an image that two stages share counts once."""
    return [own.number for own in {own for stage in stages for own in stage if own.kind == kind}]


def test_storage_buffers_are_bound_below_the_guaranteed_number(declared: list[tuple[str, Stages]]) -> None:
    beyond = {name: max(numbers(stages, "storage"), default=0) for name, stages in declared}
    assert {name: number for name, number in beyond.items() if number >= STORAGE_BUFFERS} == {}


def test_no_two_buffers_of_a_program_have_the_same_binding(declared: list[tuple[str, Stages]]) -> None:
    for kind in ("storage", "uniform block", "image"):
        twice = {name for name, stages in declared if len(set(numbers(stages, kind))) < len(numbers(stages, kind))}
        assert twice == set(), kind


def test_no_two_samplers_of_a_stage_have_the_same_unit(declared: list[tuple[str, Stages]]) -> None:
    for name, stages in declared:
        for stage in stages:
            units = numbers((stage,), "sampler")
            assert len(set(units)) == len(units) <= SAMPLERS_OF_A_STAGE, name


def test_outputs_images_and_storage_blocks_together_are_no_more_than_guaranteed(
    declared: list[tuple[str, Stages]],
) -> None:
    for name, stages in declared:
        blocks, images = numbers(stages, "storage"), numbers(stages, "image")
        outputs = numbers(stages[-1:], "output") if len(stages) > 1 else []
        assert len(blocks) <= STORAGE_BUFFERS, name
        assert len(blocks) + len(images) + len(outputs) <= OUTPUT_RESOURCES, name
        assert all(number < IMAGES for number in images), name


def test_uniform_blocks_are_few_and_small(declared: list[tuple[str, Stages]]) -> None:
    for name, stages in declared:
        for stage in stages:
            assert len(numbers((stage,), "uniform block")) <= BLOCKS_OF_A_STAGE, name
    assert max(UniformBinding) < UNIFORM_BINDINGS
    assert 16 * MOST_SAMPLES <= UNIFORM_BLOCK_BYTES
    assert 4 * 16 * MOST_LIGHTS <= UNIFORM_BLOCK_BYTES


def test_units_and_work_groups_are_within_the_guaranteed_ones() -> None:
    assert max(TextureUnit) < TEXTURE_UNITS
    planes = [ImageUnit.PLANES + place for place in range(1, len(PLANES))]
    images = [*map(int, DecodingImage), *map(int, ImageUnit), *planes]
    assert len(set(images)) == len(images) <= IMAGES
    assert max(images) < IMAGES
    assert max(GROUP_SIDE**2, BIN_GROUP, SCAN_GROUP, TEXEL_GROUP) <= GROUP_INVOCATIONS
