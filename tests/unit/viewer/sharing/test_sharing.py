"""A comparison of groupings: equal settings for all, views held out, and sentences that claim no more than is known."""

from dataclasses import replace

import numpy as np
import pytest

from ntc.codec.encoding import texture_set
from ntc.codec.model import Grouping
from ntc.codec.registry import codec_named
from ntc.errors import InputError
from ntc.grouping import GroupingInputs
from ntc.training.turns import CurvePoint
from tests.support.textures import texture
from viewer.sharing.candidates import candidates, compared_groupings
from viewer.sharing.measurement import DivergenceFigures, SharingRow, SplitViews
from viewer.sharing.report import sentences, sharing_figure
from viewer.sharing.settings import SharingSettings

TEXTURES = tuple(texture(32, 32, seed=number) for number in range(8))


def row(name: str, decoders: int, psnr_db: float, excess: int, size: int, seed: int = 0) -> SharingRow:
    figures = DivergenceFigures(views=1, blocks=100, divergent_blocks=excess, excess=excess, score=excess / 100)
    return SharingRow(
        name=name,
        grouping=name.split("-", maxsplit=1)[0],
        codec="grid",
        decoders=decoders,
        seed=seed,
        steps=10,
        samples=100,
        seconds=1.0,
        psnr_db=psnr_db,
        worst_db=psnr_db,
        worst_texture="wood",
        bytes=size,
        decoder_bytes=0,
        latent_bytes=size,
        held_out=figures,
        optimised=figures,
        ms={},
        curve=(CurvePoint(5, 0.5, psnr_db - 1.0), CurvePoint(10, 1.0, psnr_db)),
    )


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"steps": 0}, "--steps 0: must be at least 1"),
        ({"seeds": (1, 1)}, "--seed: names 1 twice"),
        ({"groupings": ()}, "--groupings and --seed: name at least one"),
        ({"bits": 2.0}, "--bits: codec grid stores a fixed number of bits"),
        ({"groupings": ("universal",)}, "--groupings universal: codec grid ships no decoder"),
        ({"codec": "block", "seeds": (0, 1)}, "--seed: codec block draws no random numbers"),
    ],
)
def test_settings_that_cannot_be_compared_are_refused(wrong: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(SharingSettings(), **wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("codec", ["grid", "block"])
def test_candidates_differ_in_grouping_and_seed_alone(codec: str) -> None:
    seeds = (0, 1) if codec == "grid" else (0,)
    settings = SharingSettings(codec=codec, groupings=("baseline", "random", "single"), clusters=(2, 3), seeds=seeds)  # type: ignore[arg-type]
    groupings = compared_groupings(settings, TEXTURES, GroupingInputs())
    made = candidates(settings, TEXTURES, groupings)
    assert [each.name for each in made[:: len(seeds)]] == ["baseline", "random-2", "random-3", "single"]
    assert len({each.request.codec for each in made}) == 1
    assert len({each.request.training for each in made}) == len(seeds)
    assert texture_set(TEXTURES, 1).channels == 3
    assert codec_named(codec).trains == (codec == "grid")


def test_every_second_view_is_held_out() -> None:
    views = [np.full((8, 8), number, np.int32) for number in range(5)]
    split = SplitViews.of(views)
    assert [int(view[0, 0]) for view in split.optimised] == [0, 2, 4]
    assert [int(view[0, 0]) for view in split.held_out] == [1, 3]
    assert len(SplitViews.of(views[:1]).held_out) == 1


def test_divergence_counts_decoders_and_not_textures() -> None:
    view = np.full((8, 16), -1, np.int32)
    view[:, :4], view[:, 4:8], view[:, 8:12] = 0, 1, 2
    figures = DivergenceFigures.of([view], Grouping("baseline", (0, 1, 2)))
    assert (figures.blocks, figures.divergent_blocks, figures.excess, figures.score) == (2, 1, 1, 0.5)
    assert DivergenceFigures.of([view], Grouping("single", (0, 0, 0))).excess == 0


def test_sentences_name_differences_to_a_decoder_per_texture() -> None:
    rows = [row("baseline", 8, 30.0, 100, 1000), row("clustered-2", 2, 29.4, 50, 500), row("single", 1, 29.98, 0, 980)]
    assert sentences(rows) == [
        "clustered with 2 decoders: 0.6 dB below a decoder per texture, 50 % of its divergence, 50 % of its bytes.",
        "single with 1 decoder: as good as a decoder per texture, no divergence, the same size.",
    ]
    assert sentences(rows[1:]) == []


def test_a_difference_below_the_spread_of_seeds_is_not_claimed() -> None:
    rows = [
        *(row("baseline", 8, psnr_db, 100, 1000, seed) for seed, psnr_db in enumerate((30.0, 30.5))),
        *(row("clustered-2", 2, psnr_db, 100, 1000, seed) for seed, psnr_db in enumerate((29.9, 29.9))),
    ]
    (sentence,) = sentences(rows)
    assert sentence.startswith("clustered with 2 decoders: as good as a decoder per texture")


def test_picture_has_a_point_for_each_grouping_and_a_curve_for_each_seed() -> None:
    rows = [row("baseline", 8, 30.0, 100, 1000), *(row("single", 1, 29.0, 0, 500, seed) for seed in range(3))]
    scatter, curves = sharing_figure(rows, "scene").axes
    assert len(scatter.containers) == 2
    assert len(curves.lines) == 4
