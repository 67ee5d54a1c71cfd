"""The speed of this machine: parts of textures tell it, whole encodings correct it, the data folder remembers it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.codec import Codec
from ntc.codec.encoding import EncodingChoices
from ntc.codec.model import Grouping
from ntc.codec.registry import codec_named
from ntc.codec.textures import SourceTexture
from ntc.training.encode import chosen_request
from ntc.training.messages import TrainingRequest
from viewer.training.pace import LEAST_SECONDS, MOST_CORRECTION, Pace

BLOCK = codec_named("block")


@pytest.fixture(autouse=True)
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("NTC_VIEWER_DATA_DIR", str(tmp_path))
    return tmp_path / "pace.json"


def request_of(codec: Codec = BLOCK, side: int = 64) -> TrainingRequest:
    pixels = np.random.default_rng(0).integers(0, 256, (side, side, 3), np.uint8)
    texture = SourceTexture("noise", pixels, "")
    return chosen_request([texture] * 2, Grouping("baseline", (0, 1)), codec, EncodingChoices())


def test_a_run_that_has_ended_tells_the_time_of_the_next_one() -> None:
    assert Pace().expected_seconds(request_of()) is None
    Pace().note_run(request_of(), 40.0)
    assert Pace().expected_seconds(request_of()) == pytest.approx(40.0)
    more = Pace().expected_seconds(request_of(side=256))
    assert more is not None
    assert more > 80.0


def test_a_run_corrects_what_parts_of_textures_promise() -> None:
    pace = Pace()
    pace.note_part("block", 1e-5)
    promised = pace.expected_seconds(request_of())
    assert promised is not None
    # Parts were twice as slow as the whole.
    scaled = LEAST_SECONDS / promised
    pace.note_part("block", 1e-5 * scaled * 8.0)
    pace.note_run(request_of(), 4.0 * LEAST_SECONDS)
    assert Pace().expected_seconds(request_of()) == pytest.approx(4.0 * LEAST_SECONDS)
    # The machine is three times as busy now.
    pace.note_part("block", 1e-5 * scaled * 24.0)
    assert pace.expected_seconds(request_of()) == pytest.approx(12.0 * LEAST_SECONDS)


def test_a_correction_has_its_limits() -> None:
    pace = Pace()
    pace.note_part("block", 1e-12)
    pace.note_run(request_of(), 1000.0)
    assert pace.seconds_per_work(BLOCK) == pytest.approx(MOST_CORRECTION * 1e-12)


def test_what_says_nothing_about_speed_is_not_learned(data: Path) -> None:
    request, trained = request_of(), request_of(codec_named("grid"))
    pace = Pace()
    pace.note_run(request, 0.5 * LEAST_SECONDS)
    pace.note_run(trained, 100.0)
    pack = BLOCK.starting_pack(request.textures, request.grouping, request.codec)
    pace.note_run(replace(request, start=pack), 100.0)
    assert pace.expected_seconds(trained) is None
    assert not data.exists()


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"block": 1e-5}', '{"block": {"part": -1}}', '{"block": {"run": 1e9}}']
)
def test_a_file_that_says_nothing_is_as_none(data: Path, text: str) -> None:
    data.write_text(text)
    assert Pace().seconds_per_work(BLOCK) is None
    Pace().note_part("block", 1e-5)
    assert Pace().seconds_per_work(BLOCK) == 1e-5
