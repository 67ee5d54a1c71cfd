"""Progress of an encoding rises to its end, whatever is asked for."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.block.encoding.progress import WorkCount
from ntc.codec.encoding import BitsTarget, EncodingChoices, QualityTarget
from ntc.codec.model import Grouping
from ntc.codec.registry import codec_named
from ntc.codec.textures import SourceTexture
from ntc.training.encode import chosen_request, encode_request
from ntc.training.messages import TrainingProgress


def checkers(side: int, seed: int) -> SourceTexture:
    """Sharp edges, whose averages are far from the mips: fewer mips per code pay."""
    random = np.random.default_rng(seed)
    cells = random.integers(0, 2, (side // 2, side // 2, 1)) * random.integers(80, 255, (1, 1, 3))
    pixels = np.kron(cells, np.ones((2, 2, 1))).astype(np.uint8)
    return SourceTexture(f"checkers {seed}", pixels, str(seed))


@pytest.mark.parametrize(
    ("name", "options", "choices"),
    [
        ("single", {}, EncodingChoices()),
        ("two", {}, EncodingChoices(target=BitsTarget(6.0))),
        ("two", {"groups_apart": True, "preview_side": 16}, EncodingChoices()),
        ("two", {"threads": 3}, EncodingChoices(target=QualityTarget(30.0))),
        ("universal", {"groups_apart": True}, EncodingChoices()),
    ],
)
def test_progress_rises_to_the_end(
    name: str, options: dict[str, Any], choices: EncodingChoices, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ntc.training.trainer.SECONDS_BETWEEN_REPORTS", 0.0)
    before: list[float] = []
    add = WorkCount.add

    def adding(count: WorkCount, work: float) -> None:
        if work:
            before.append(count.share)
        add(count, work)

    monkeypatch.setattr(WorkCount, "add", adding)
    textures = [checkers(128, seed) for seed in range(4)]
    grouping = Grouping(name, (0, 1, 0, 1)) if name == "two" else Grouping(name, (0,) * 4)
    if name == "universal":
        grouping = replace(grouping, parameters=dict(codec_named("block").shipped))
    request = chosen_request(textures, grouping, codec_named("block"), choices)
    assert isinstance(request.training, BlockOptions)
    assert isinstance(request.codec, BlockConfig)
    reports: list[TrainingProgress] = []
    pack = encode_request(replace(request, training=replace(request.training, **options)), reports.append)
    if choices.target == BitsTarget(6.0):
        assert any(texture.code_mips for texture in pack.textures), "one is encoded again"
    shares = [report.share for report in reports]
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)
    assert max(before) < 1.0, "100 % means that no work is left"
    assert all(1 <= report.step <= report.steps for report in reports if report.steps)


def test_the_share_never_falls_when_more_is_planned() -> None:
    count = WorkCount()
    assert count.share == 0.0
    count.expect(10.0)
    count.add(5.0)
    assert count.share == 0.5
    count.expect(5.0)
    assert count.share == 0.5
    count.add(5.0)
    assert count.share == 0.75
    count.expect(-4.0)
    count.add(1.0)
    assert count.share == 1.0
