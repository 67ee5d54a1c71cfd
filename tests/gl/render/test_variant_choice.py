"""Variants of the decoder: measured where it is asked for, kept for the driver, and shown by `doctor`."""

from dataclasses import replace
from pathlib import Path

import pytest

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.gpu import GPU, SOFTWARE
from ntc.codec.grid.model import GridConfig
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from viewer.cli.doctor import examine
from viewer.gl.context import GraphicsContext
from viewer.locations import variants_cache
from viewer.render.resources.decoding_shaders import NVIDIA, default_variant
from viewer.render.variants import (
    LARGEST_FILE,
    VARIANT_VARIABLE,
    VariantChoice,
    VariantMeasurement,
    VariantTimes,
    keep_times,
    kept_times,
    read_times,
)

SMALL = GridConfig(hidden_width=8, positional_octaves=1)
SHAPE = codec_of(SMALL).gpu_tables(SMALL).shape_text()
TIMES = VariantTimes({"fp32": {GPU: 0.5, NVIDIA: 0.25}, "fp16": {GPU: 0.2}})


@pytest.mark.computes
def test_each_class_of_device_has_its_default(graphics: GraphicsContext) -> None:
    on_gpu = replace(graphics, info=replace(graphics.info, renderer="a GPU"))
    nvidia = replace(on_gpu, info=replace(on_gpu.info, vendor="NVIDIA Corporation"))
    in_buffers = replace(graphics, features=replace(graphics.features, weights_in_image=False))
    assert default_variant(in_buffers, SMALL) == replace(SOFTWARE, weights="uniforms")
    assert default_variant(graphics, SMALL) == SOFTWARE
    assert default_variant(on_gpu, SMALL) == GPU
    assert default_variant(nvidia, SMALL) == NVIDIA
    assert default_variant(nvidia, GridConfig(hidden_width=128)) == GPU


@pytest.mark.computes
def test_what_is_measured_is_kept_and_told_once(graphics: GraphicsContext, tmp_path: Path) -> None:
    pack, told = random_pack(config=SMALL), list[str]()
    choice = VariantChoice("measured", tmp_path, told.append)
    choice_again = VariantChoice("measured", tmp_path, told.append)
    measured = VariantMeasurement(graphics, pack).times(seconds=0.0)
    assert [list(own) for own in measured.nanoseconds.values()] == [[SOFTWARE]], "one at least"
    keep_times(tmp_path, graphics.info, SHAPE, TIMES)
    assert choice.variant(graphics, pack, "fp32") == NVIDIA
    assert choice.variant(graphics, pack, "fp16") == choice_again.variant(graphics, pack, "fp16") == GPU
    assert choice.variant(graphics, pack, "fp16-accumulate") == SOFTWARE, "not measured"
    assert choice.precisions(graphics, pack) == ("fp16", "fp32"), "by time"
    assert told == []


@pytest.mark.computes
def test_nothing_is_measured_unasked_on_software(graphics: GraphicsContext, tmp_path: Path) -> None:
    pack = random_pack(config=SMALL)
    for wanted in ("", "default"):
        assert VariantChoice(wanted, tmp_path).variant(graphics, pack, "fp32") == SOFTWARE
    assert VariantChoice("pixels=2", tmp_path).variant(graphics, pack, "fp32") == NVIDIA
    assert list(tmp_path.iterdir()) == []


@pytest.mark.computes
def test_codes_are_timed_alone_and_together(graphics: GraphicsContext, tmp_path: Path) -> None:
    pack, told = random_block_pack(), list[str]()
    variants = {replace(SOFTWARE, together=0), replace(SOFTWARE, together=1)}
    times = VariantMeasurement(graphics, pack).times(seconds=60.0)
    assert set(times.nanoseconds["fp32"]) == set(times.nanoseconds["fp16"]) == variants
    choice = VariantChoice("measured", tmp_path, told.append)
    assert choice.variant(graphics, pack, "fp32") in variants
    assert [line.startswith("decoder block 8x8") for line in told] == [True]


def test_kept_times_of_another_driver_or_spoilt_ones_are_none(graphics: GraphicsContext, tmp_path: Path) -> None:
    info, shape = graphics.info, SHAPE
    keep_times(tmp_path, info, shape, TIMES)
    assert read_times(tmp_path, info, shape) == TIMES
    assert kept_times(tmp_path, info) == {shape: TIMES}
    newer = replace(info, version="99")
    assert read_times(tmp_path, newer, shape) is None
    assert kept_times(tmp_path, newer) == {}
    (path,) = tmp_path.iterdir()
    whole = path.read_text()
    for spoilt in (
        "",
        "[]",
        "{}",
        whole[:-9],
        whole.replace("0.25", "-1"),
        whole.replace("0.25", "NaN"),
        whole.replace("fp16", "fp8"),
    ):
        path.write_text(spoilt)
        assert read_times(tmp_path, info, shape) is None
    path.write_text(whole + " " * LARGEST_FILE)
    assert read_times(tmp_path, info, shape) is None


def test_the_environment_and_an_option_name_a_variant(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIANT_VARIABLE, "pixels=2")
    assert VariantChoice.of_environment("", print).wanted == "pixels=2"
    assert VariantChoice.of_environment("default", print).wanted == "default"
    with pytest.raises(InputError, match="pixels"):
        VariantChoice.of_environment("pixels=99", print)


def test_doctor_shows_what_was_measured(graphics: GraphicsContext) -> None:
    keep_times(variants_cache(), graphics.info, SHAPE, TIMES)
    lines = examine()["opengl"]["measured_variants"]
    assert any(f"fp32 0.250 ns a texel with {NVIDIA}" in line for line in lines)
