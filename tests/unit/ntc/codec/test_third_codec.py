"""A codec that the registry gets from tests: files, reference and torch, and the one trainer need no more than its methods."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.codec import Codec
from ntc.codec.config import WrapMode
from ntc.codec.encoding import BitsTarget, EncodingChoices
from ntc.codec.maps import MAPS
from ntc.codec.model import Grouping, Pack
from ntc.codec.reference import decode_image
from ntc.codec.registry import MODULES, chosen_codec, codec_named
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError, TrainingCancelledError
from ntc.pack.file import read_pack, write_pack
from ntc.training.encode import encode_textures
from ntc.training.messages import GroupSnapshot, TrainingProgress, TrainingRequest, checked_request
from ntc.training.trainer import Trainer
from tests.support.packs.checks import assert_equal
from tests.support.packs.parity import assert_torch_agrees
from tests.support.two_colors import NAME, encoded, registered

WRAPS: tuple[WrapMode, ...] = ("repeat", "mirror", "clamp")
SHAPES = ((64, 64, 3), (17, 33, 1), (1, 1, 2), (8, 5, 4))
GROUPS = (0, 1, 0, 1)


@pytest.fixture(scope="module", autouse=True)
def codec() -> Iterator[Codec]:
    with registered():
        yield codec_named(NAME)
    assert NAME not in MODULES


def ramps(width: int, height: int, channels: int, number: int = 0) -> SourceTexture:
    """Along u and v, a channel steeper than the one before."""
    u, v = np.linspace(0.0, 100.0, width), np.linspace(20.0, 120.0, height)[:, None]
    pixels = np.stack([u + v * (1.0 + number) / (1 + channel) for channel in range(channels)], -1)
    found = np.clip(np.rint(pixels), 0, 255).astype(np.uint8)
    return SourceTexture(f"ramps {number}", found, hash_pixels(found), wrap=(WRAPS[number % 3], WRAPS[number // 2]))


TEXTURES = tuple(ramps(*shape, number) for number, shape in enumerate(SHAPES))


@pytest.fixture(scope="module", params=["base colours", "materials"])
def pack(codec: Codec, request: pytest.FixtureRequest) -> Pack:
    if request.param == "base colours":
        return encoded(TEXTURES, GROUPS)
    return encoded(
        [replace(ramps(30, 20, 11), maps=MAPS), replace(ramps(9, 9, 4, 1), maps=("base", "roughness"))], (0, 1)
    )


def test_a_file_holds_the_pack_and_no_decoder(pack: Pack, tmp_path: Path) -> None:
    path = tmp_path / "pack.ntc"
    write_pack(path, pack)
    read = read_pack(path)
    assert_equal(pack, read)
    assert len(read.decoders) == 2


def test_reference_and_torch_agree(pack: Pack) -> None:
    random = np.random.default_rng(3)
    for index in range(len(pack.textures)):
        uv = random.uniform(-2.0, 3.0, (500, 2)).astype(np.float32)
        lod = random.uniform(-1.0, 8.0, 500).astype(np.float32)
        for wrap in (None, *((mode, mode) for mode in WRAPS)):
            assert_torch_agrees(pack, index, uv, lod, wrap)
        image = codec_named(NAME).torch_twin(pack, "cpu").decode_image(index)
        assert (image == decode_image(pack, index)).all()


def test_what_is_two_colours_is_exact_and_ramps_are_near(codec: Codec) -> None:
    pixels = np.where(np.indices((8, 12)).sum(0)[..., None] % 2, [200, 30, 5], [0, 90, 250]).astype(np.uint8)
    checker = SourceTexture("checker", pixels, hash_pixels(pixels))
    pack = encoded([checker, TEXTURES[0]], (0, 0))
    assert (decode_image(pack, 0) == pixels).all()
    assert (pack.textures[1].psnr_db or 0.0) > 35.0


class Host:
    """Keeps what a training reports."""

    def __init__(self) -> None:
        self.shares: list[float] = []
        self.snapshots: list[GroupSnapshot] = []

    def interruption(self) -> None:
        """Never."""

    def seconds(self) -> float:
        return float(len(self.shares))

    def progress(self, progress: TrainingProgress) -> None:
        self.shares.append(progress.share)

    def wants_snapshot(self, group: int) -> bool:
        return True

    def snapshot(self, snapshot: GroupSnapshot) -> None:
        self.snapshots.append(snapshot)


def test_the_trainer_reports_and_goes_on_from_a_pack(codec: Codec) -> None:
    pack, host = encoded(TEXTURES, GROUPS), Host()
    options = codec.live_options_for(EncodingChoices())
    start = codec.starting_pack(TEXTURES, pack.grouping, pack.config)
    assert [t.blocks.shape for t in start.textures] == [t.blocks.shape for t in pack.textures]  # type: ignore[attr-defined]
    request = TrainingRequest(TEXTURES, pack.grouping, pack.config, options, start=pack, dirty=frozenset({1}))
    ended = Trainer(checked_request(request), host).run()
    assert host.shares == sorted(host.shares)
    assert host.shares[-1] == 1.0
    (last,) = host.snapshots
    assert (last.group, last.final, last.members) == (1, True, (1, 3))
    assert ended.outcomes[0].before_db == ended.outcomes[0].after_db


def test_it_can_be_cancelled(codec: Codec) -> None:
    options, asked = codec.options_for(EncodingChoices()), iter([False, True, True])
    settings = encoded(TEXTURES, GROUPS).config
    with pytest.raises(TrainingCancelledError):
        encode_textures(TEXTURES, Grouping("g", GROUPS), settings, options, cancelled=lambda: next(asked))


def test_what_it_cannot_do_is_refused_in_a_line(codec: Codec) -> None:
    assert chosen_codec(EncodingChoices()) == "block"
    assert codec.refusals(EncodingChoices()) == []
    impossible = EncodingChoices(target=BitsTarget(2.0), steps=3)
    assert chosen_codec(impossible) == "grid", "it refuses less than the last of the registry"
    assert [line.split(":")[0] for line in codec.refusals(impossible)] == ["--bits 2", "--steps 3"]
    with pytest.raises(InputError, match=f"codec {NAME} encodes with decoders of its own alone"):
        codec.encode_with_decoders(TEXTURES, [encoded(TEXTURES, GROUPS)], 4)
