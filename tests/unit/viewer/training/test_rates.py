"""Targets as they are typed, curves of quality by bits, and forecasts of encodings."""

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.config import GroupingName
from ntc.codec.encoding import BitsTarget, EncodingChoices, QualityTarget, SizeTarget, StepBudget, Target, texture_set
from ntc.codec.registry import codec_named
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from tests.end_to_end.conftest import two_squares
from viewer.locations import builtin_scene_path
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.scene.source_textures import MapChoice, source_textures
from viewer.training.rates import Forecast, PointJob, RateCurve, RatePoint, Rates, chosen_textures, part_of, rate_point
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


def test_more_bits_give_more_quality_and_the_work_is_timed() -> None:
    texture = _noise(64)
    whole = texture_set([texture], 1)
    few, many = (rate_point(PointJob(texture, whole, bits)) for bits in (4.0, 8.0))
    assert few.psnr_db < many.psnr_db
    assert few.by_map == {"base": few.psnr_db}
    assert few.seconds_per_work > 0.0


CURVE = RateCurve(tuple(RatePoint(bits, db, 1e-6, {}) for bits, db in ((2.0, 34.0), (4.0, 38.0), (8.0, 44.0))), 1 << 20)


def test_a_curve_answers_both_ways() -> None:
    assert CURVE.psnr_at(4.0) == pytest.approx(38.0)
    assert CURVE.bits_at(41.0) == pytest.approx(2.0**2.5)
    for bits in (1.0, 3.0, 16.0):
        assert CURVE.bits_at(CURVE.psnr_at(bits)) == pytest.approx(bits)
    alone = replace(CURVE, points=CURVE.points[1:2])
    assert alone.bits_at(alone.psnr_at(8.0)) == pytest.approx(8.0)
    assert CURVE.megabytes(8.0) == pytest.approx((1 << 20) / 1e6)


def test_a_forecast_says_what_a_target_gives(scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NTC_VIEWER_DATA_DIR", str(tmp_path))
    rates, settings = Rates(), TrainingSettings()
    rates.enter(scene)
    first = rates.forecast(settings, scene)
    assert first is not None
    assert (first.maps, first.psnr_db, first.seconds) == (2, None, None)
    rates._curves[0, "all"] = CURVE
    rates.pace.note_part("block", 1e-5)
    at_bits = rates.forecast(replace(settings, target=BitsTarget(4.0)), scene)
    at_quality = rates.forecast(replace(settings, target=QualityTarget(38.0)), scene)
    assert at_bits is not None
    assert at_quality is not None
    assert at_bits.psnr_db == pytest.approx(38.0)
    assert at_quality.bits == pytest.approx(4.0)
    assert at_quality.megabytes == pytest.approx(at_bits.megabytes)
    assert at_bits.seconds is not None
    assert 0.0 < at_bits.seconds < (at_quality.seconds or 0.0)
    # Another window of this machine knows the speed.
    assert json.loads((tmp_path / "pace.json").read_text()) == {"block": {"part": 1e-5, "run": None, "correction": 1.0}}
    again = Rates().forecast(replace(settings, target=BitsTarget(4.0)), scene)
    assert again is not None
    assert again.seconds == at_bits.seconds


@pytest.mark.parametrize("strategy", ["single", "baseline", "universal"])
@pytest.mark.parametrize("maps", ["base", "all"])
def test_an_encoding_takes_the_work_that_was_forecast(
    strategy: GroupingName, maps: MapChoice, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = load_scene(builtin_scene_path())
    # The last texture alone has an emissive map, before the occlusion that the others have.
    few = (*scene.textures[:2], scene.textures[-1])
    scene = replace(scene, textures=few)
    settings, rates = TrainingSettings(strategy=strategy, maps=maps), Rates()
    monkeypatch.setattr(rates.pace, "seconds_per_work", lambda _codec: 1.0)
    forecast = rates.forecast(settings, scene)
    sources = source_textures(scene, None, maps)
    count = len(few) if strategy == "baseline" else 1
    codec, ships = codec_named("block"), strategy == "universal"
    config = codec.settings_for(texture_set(sources, 0 if ships else count), settings.choices)
    groups = [[source.size for source in sources[first::count]] for first in range(count)]
    assert forecast is not None
    assert forecast.seconds == pytest.approx(
        codec.encoding_work(groups, config, codec.live_options_for(settings.choices), ships)
    )


def test_no_time_is_forecast_for_a_target_out_of_reach(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    rates = Rates()
    monkeypatch.setattr(rates.pace, "seconds_per_work", lambda _codec: 1.0)
    forecast = rates.forecast(TrainingSettings(target=BitsTarget(900.0)), scene)
    assert forecast is not None
    assert forecast.seconds is None


def test_the_line_of_a_forecast() -> None:
    found = Forecast(1, 5, (2048, 2048), True, 2.1, 39.3, 41.7)
    assert found.line() == "5 maps of 2048x2048 -> about 2.1 MB, about 39 dB, about 42 s on this machine"
    assert Forecast(9, 23, (512, 512), False).line() == "23 maps of up to 512x512"


@pytest.mark.process
def test_curves_are_measured_beside_the_frames(scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NTC_VIEWER_DATA_DIR", str(tmp_path))
    rates = Rates()
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
        assert rates.pace.seconds_per_work(codec_named("block"))
        assert ticks > 20, "ticks do not wait for what is measured"
    finally:
        rates.close()


def test_encoding_work_counts_texels_where_a_codec_does_not_say() -> None:
    grid = codec_named("grid")
    options = grid.options_for(EncodingChoices())
    assert grid.encoding_work([[(4, 4)], [(8, 8)]], grid.settings_type(), options, ships=False) == 80 * 3
