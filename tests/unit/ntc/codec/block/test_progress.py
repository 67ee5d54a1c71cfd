"""The work of an encoding is counted as it was planned, whatever is asked for."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.block.encoding.blocks import prepare_texture, sample_textures
from ntc.codec.block.encoding.edges import edge_kinds
from ntc.codec.block.encoding.encoder import texture_choices
from ntc.codec.block.encoding.groups import Redone, encode_member, fitted_groups
from ntc.codec.block.encoding.progress import WorkCount
from ntc.codec.block.encoding.rate import (
    CHOICES_WORK,
    TYPICAL_KINDS,
    channel_work,
    encoding_work,
    judging_work,
)
from ntc.codec.block.encoding.tables import fit_decoder
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
def test_all_planned_work_is_done_at_the_end(
    name: str, options: dict[str, Any], choices: EncodingChoices, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ntc.training.trainer.SECONDS_BETWEEN_REPORTS", 0.0)
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
    assert reports[-1].work_done == pytest.approx(reports[-1].work_planned)
    assert reports[-1].seconds_left == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("options", "count"),
    [
        ({}, 4),
        ({"groups_apart": True, "preview_side": 16}, 4),
        ({"threads": 3}, 4),
        # With those of their preview they would not be few.
        ({"groups_apart": True, "preview_side": 16, "threads": 4}, 6),
    ],
)
def test_what_is_planned_at_first_is_what_was_forecast(
    options: dict[str, Any], count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ntc.training.trainer.SECONDS_BETWEEN_REPORTS", 0.0)
    textures = [checkers(128, seed) for seed in range(count)]
    request = chosen_request(textures, Grouping("two", (0, 1) * (count // 2)), codec_named("block"), EncodingChoices())
    assert isinstance(request.training, BlockOptions)
    assert isinstance(request.codec, BlockConfig)
    training, config = replace(request.training, **{"threads": 1, **options}), request.codec
    assert training.threads is not None
    reports: list[TrainingProgress] = []
    encode_request(replace(request, training=training), reports.append)
    work = encoding_work([[(128, 128)] * (count // 2)] * 2, config, training, ships=False, threads=training.threads)
    assert reports[0].work_planned == pytest.approx(work / channel_work(config))


def test_a_texture_of_a_group_of_its_own_is_encoded_by_one_thread_where_textures_are_many() -> None:
    config, training = BlockConfig(modes=8, coefficients=24), BlockOptions(groups_apart=True)
    many = [[(256, 256)]] * 12
    assert encoding_work(many, config, training, False, 2) == encoding_work(many, config, training, False, 1)
    # Where they are few, all threads share each.
    few = many[:3]
    assert encoding_work(few, config, training, False, 2) < encoding_work(few, config, training, False, 1)
    together = [[(256, 256)] * 12]
    assert encoding_work(together, config, training, False, 2) < encoding_work(together, config, training, False, 1)


@pytest.mark.parametrize("bits", [0, 1])
def test_choices_among_more_kinds_of_edge_parts_are_more_work(bits: int, monkeypatch: pytest.MonkeyPatch) -> None:
    config = BlockConfig(modes=8, coefficients=24)
    texture = prepare_texture(checkers(64, 0), config)
    decoder = fit_decoder(sample_textures([checkers(64, 0)], config), config)
    kinds = tuple(edge_kinds(decoder)) * (1 + bits)
    monkeypatch.setattr("ntc.codec.block.encoding.encoder.paying_kinds", lambda *_: kinds)
    expected: list[float] = []
    done: list[float] = []
    texture_choices(texture, decoder, config, done.append, expect=expected.append)
    blocks = len(texture.texels)
    planned = judging_work(blocks) + CHOICES_WORK * TYPICAL_KINDS * blocks
    assert sum(expected) == pytest.approx(CHOICES_WORK * (len(kinds) - TYPICAL_KINDS) * blocks)
    assert sum(done) == pytest.approx(planned + sum(expected))


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


def test_progress_is_even_while_a_texture_is_encoded_again(monkeypatch: pytest.MonkeyPatch) -> None:
    source = checkers(256, 0)
    request = chosen_request(
        [source], Grouping("single", (0,)), codec_named("block"), EncodingChoices(target=BitsTarget(6.0))
    )
    assert isinstance(request.codec, BlockConfig)
    (fitted,) = fitted_groups([source], request.grouping, (0,), request.codec, 0)
    taken: list[float] = []
    take = Redone.take

    def taking(redone: Redone, work: float) -> float:
        taken.append(take(redone, work))
        return taken[-1]

    monkeypatch.setattr(Redone, "take", taking)
    encode_member(source, request.codec.mean_words, fitted, request.codec, lambda _: None)
    assert max(taken) < 0.7 * sum(taken)


def test_what_is_encoded_again_counts_as_it_was_planned() -> None:
    count = WorkCount()
    redone = Redone(2.0, count.expect)
    redone.plan(3.0)
    assert count.planned == 1.0
    assert [redone.take(2.0), redone.take(2.0), redone.take(2.0)] == [2.0, 1.0, 0.0]
    redone.plan(0.0)
    assert count.planned == 1.0
