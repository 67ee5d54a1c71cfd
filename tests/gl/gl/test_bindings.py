"""Every program keeps to what OpenGL 4.3 guarantees (tables 23.55 to 23.64), whatever the driver at hand offers beyond."""

from collections import Counter

import pytest

from tests.support.declarations import Declaration, declarations
from tests.support.every_program import AssembledProgram
from viewer.lighting.prefilter import MOST_SAMPLES
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


@pytest.fixture(scope="module")
def declared(programs: tuple[AssembledProgram, ...]) -> list[tuple[str, Stages]]:
    """Of each program its files, and what each of its stages declares."""
    of_text = {text: declarations(text) for program in programs for text in program.texts}
    return [(" + ".join(program.files), tuple(of_text[text] for text in program.texts)) for program in programs]


def numbers(stages: Stages, kind: str) -> list[int]:
    """Those of all stages; a block or an image that two stages share counts once."""
    return [own.number for own in {own for stage in stages for own in stage if own.kind == kind}]


def test_declarations_are_found(declared: list[tuple[str, Stages]]) -> None:
    found = Counter(own.kind for _, stages in declared for stage in stages for own in stage)
    assert set(found) == {"storage", "uniform block", "sampler", "image", "output"}


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
    assert max(ImageUnit) < IMAGES
    assert max(GROUP_SIDE**2, BIN_GROUP, SCAN_GROUP, TEXEL_GROUP) <= GROUP_INVOCATIONS
