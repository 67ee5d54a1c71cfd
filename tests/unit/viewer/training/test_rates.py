"""Targets as they are typed, curves of quality by bits, and forecasts of encodings."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.encoding import (
    BitsTarget,
    QualityTarget,
    SizeTarget,
    StepBudget,
    Target,
    texture_set,
)
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from tests.end_to_end.conftest import two_squares
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.training.rates import (
    PointJob,
    RateCurve,
    RateCurves,
    RatePoint,
    chosen_textures,
    part_of,
    rate_point,
)
from viewer.training.settings import TrainingSettings, parse_target, target_text, with_setting


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return load_scene(two_squares().write(tmp_path / "scene.glb"))


@pytest.mark.parametrize(
    ("text", "target"),
    [
        ("4", BitsTarget(4.0)),
        ("2.5bits", BitsTarget(2.5)),
        ("40 dB", QualityTarget(40.0)),
        ("2.8mb", SizeTarget(2.8)),
        ("auto", None),
    ],
)
def test_targets_are_typed_with_their_unit(text: str, target: Target | None) -> None:
    assert parse_target(text) == target
    assert parse_target(target_text(target)) == target


@pytest.mark.parametrize("text", ["", "four", "4 bit", "0", "70dB", "-1", "0MB"])
def test_other_targets_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="target"):
        parse_target(text)


def test_a_codec_that_does_not_train_takes_no_recipe_and_no_steps() -> None:
    trained = replace(TrainingSettings(), recipe="paper", budget=StepBudget(100), codec="grid")
    settings = with_setting(trained, "codec", "block")
    assert (settings.codec_kind, settings.recipe, settings.budget) == ("block", "best", TrainingSettings.budget)
    assert with_setting(settings, "codec", "auto").codec is None
    with pytest.raises(InputError, match="size"):
        with_setting(settings, "size", "2")


def test_the_chosen_textures_are_encoded(scene: Scene) -> None:
    assert chosen_textures(TrainingSettings(), scene) == (0, 1)
    assert chosen_textures(with_setting(TrainingSettings(), "textures", "1"), scene) == (1,)


def _noise(side: int) -> SourceTexture:
    pixels = np.random.default_rng(0).integers(0, 256, (side, side, 3), np.uint8)
    return SourceTexture("noise", pixels, "")


def test_a_part_has_tiles_of_the_whole_texture() -> None:
    whole = _noise(512)
    part = part_of(whole, 128, 64)
    assert part.size == (128, 128)
    tiles = {whole.pixels[y : y + 64, x : x + 64].tobytes() for y in range(0, 512, 64) for x in range(0, 512, 64)}
    assert all(part.pixels[y : y + 64, x : x + 64].tobytes() in tiles for y in (0, 64) for x in (0, 64))
    assert part_of(_noise(64), 128, 64).size == (64, 64)


def test_more_bits_give_more_quality() -> None:
    texture = _noise(64)
    whole = texture_set([texture], 1)
    few, many = (rate_point(PointJob(texture, whole, bits)) for bits in (4.0, 8.0))
    assert few.psnr_db < many.psnr_db
    assert few.by_map == {"base": few.psnr_db}


CURVE = RateCurve(tuple(RatePoint(bits, db, {}) for bits, db in ((2.0, 34.0), (4.0, 38.0), (8.0, 44.0))), 1 << 20)


def test_a_curve_answers_both_ways() -> None:
    assert CURVE.psnr_at(4.0) == pytest.approx(38.0)
    assert CURVE.bits_at(41.0) == pytest.approx(2.0**2.5)
    for bits in (1.0, 3.0, 16.0):
        assert CURVE.bits_at(CURVE.psnr_at(bits)) == pytest.approx(bits)
    alone = replace(CURVE, points=CURVE.points[1:2])
    assert alone.bits_at(alone.psnr_at(8.0)) == pytest.approx(8.0)
    assert CURVE.megabytes(8.0) == pytest.approx((1 << 20) / 1e6)


def test_a_forecast_says_what_a_target_gives(scene: Scene) -> None:
    rates, settings = RateCurves(), TrainingSettings(target=BitsTarget(4.0))
    rates.enter(scene)
    rates._curves[0, "all"] = CURVE
    rates._ended.add((0, "all"))
    first = rates.forecast(settings, scene)
    assert first is not None
    assert (first.maps, first.psnr_db, first.time) == (2, None, "seconds"), "not before all curves are measured"
    rates._ended.add((1, "all"))
    rates.version += 1
    at_bits = rates.forecast(settings, scene)
    at_quality = rates.forecast(replace(settings, target=QualityTarget(38.0)), scene)
    assert at_bits is not None
    assert at_quality is not None
    assert at_bits.psnr_db == pytest.approx(38.0)
    assert at_quality.bits == pytest.approx(4.0)
    assert at_quality.megabytes == pytest.approx(at_bits.megabytes)


@pytest.mark.process
def test_curves_are_measured_beside_the_frames(scene: Scene) -> None:
    rates = RateCurves()
    rates.want(scene, [0])
    rates.want(scene, [0])
    began, ticks = time.monotonic(), 0
    try:
        while rates.is_busy:
            assert time.monotonic() - began < 100.0
            rates.tick(may_start=True)
            ticks += rates.is_busy
            time.sleep(0.01)
        curve = rates.curve(0)
        assert curve is not None
        assert len(curve.points) > 1
        assert ticks > 20, "ticks do not wait for what is measured"
    finally:
        rates.close()
