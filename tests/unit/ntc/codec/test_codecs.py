"""Every codec keeps to the interface, also one that only tests add, and what is of no codec asks the registry."""

import json
import tomllib
from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, cast, get_args

import grimp
import numpy as np
import pytest

from ntc.codec.codec import Codec
from ntc.codec.config import WrapMode
from ntc.codec.encoding import BitsTarget, EncodingChoices
from ntc.codec.maps import MAP_CHANNELS, MAPS
from ntc.codec.model import CodecSettings, Grouping, Pack
from ntc.codec.reference import decode_image
from ntc.codec.registry import (
    FIRST_NAME,
    MODULES,
    SUMMARIES,
    CodecName,
    chosen_codec,
    codec_named,
    codec_of,
)
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError, TrainingCancelledError
from ntc.pack.file import read_pack, write_pack
from ntc.pack.schema import KIND
from ntc.training.encode import encode_textures
from ntc.training.messages import GroupSnapshot, TrainingProgress, TrainingRequest, checked_request
from ntc.training.trainer import Trainer
from tests.support.pack_bytes import PackBytes
from tests.support.packs.checks import assert_equal
from tests.support.packs.parity import assert_torch_agrees
from tests.support.two_colors import NAME, encoded, registered

ROOT = Path(__file__).resolve().parents[4]
CHOICES_OF_THE_USER = {"ntc", "ntc.api"}
"""They name `TrainingConfig`, which callers of the library fill in."""


def settings_of(name: str) -> list[CodecSettings]:
    """Settings with defaults, and with other values of what every codec has."""
    plain = codec_named(name).settings_type()
    channels = sum(MAP_CHANNELS[each] for each in MAPS)
    changes: list[dict[str, Any]] = [
        {},
        {"levels": 1, "output_channels": 4},
        {"output_channels": channels, "maps": MAPS},
    ]
    return [replace(cast(Any, plain), **change) for change in changes]


def empty_file(folder: Path, settings: CodecSettings) -> Path:
    """A pack file without textures."""
    path = folder / "empty.ntc"
    write_pack(path, Pack(settings, Grouping("baseline", ()), (), ()))
    return path


def test_there_is_a_codec_in_every_folder_and_no_other() -> None:
    found = {path.parent.name for path in (ROOT / "ntc" / "codec").glob("*/codec.py")}
    assert found == set(MODULES)
    assert FIRST_NAME in MODULES
    assert set(SUMMARIES) == set(get_args(CodecName)) == set(MODULES)
    with pytest.raises(KeyError):
        codec_named("wavelet")


@pytest.mark.parametrize("name", MODULES)
def test_a_codec_has_every_method_and_no_state(name: str) -> None:
    codec = codec_named(name)
    assert isinstance(codec, Codec)
    assert type(codec).__abstractmethods__ == frozenset()
    assert vars(codec) == {}
    settings = codec.settings_type()
    assert is_dataclass(settings)
    assert settings.kind == name
    assert codec_of(settings) is codec
    with pytest.raises(AttributeError):
        cast(Any, settings).levels = 2


@pytest.mark.parametrize("name", MODULES)
def test_settings_come_back_from_a_file(tmp_path: Path, name: str) -> None:
    for settings in settings_of(name):
        path = empty_file(tmp_path, settings)
        assert read_pack(path).config == settings
        metadata = PackBytes.of(path.read_bytes()).metadata["codec"]
        assert metadata.get(KIND, FIRST_NAME) == name
        assert json.loads(json.dumps(metadata)) == metadata


@pytest.mark.parametrize("name", MODULES)
def test_files_may_lack_the_fields_that_were_added_and_no_others(tmp_path: Path, name: str) -> None:
    codec = codec_named(name)
    settings = codec.settings_type()
    known = {field.name: field.default for field in fields(cast(Any, settings))}
    assert codec.added_fields <= set(known)
    path = empty_file(tmp_path, settings)
    pieces = PackBytes.of(path.read_bytes())
    for field, default in known.items():
        path.write_bytes(pieces.changed(lambda parts, field=field: parts.metadata["codec"].pop(field, None)))  # type: ignore[misc]
        if field in codec.added_fields:
            assert default is not MISSING
            assert read_pack(path).config == settings
        else:
            with pytest.raises(InputError, match=r"metadata\.codec has fields|no longer read"):
                read_pack(path)


def test_every_module_that_codecs_share_has_a_layer() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (layers,) = (each["layers"] for each in contracts if each.get("containers") == ["ntc.codec"])
    named = {module.strip() for layer in layers for module in layer.split("|")}
    assert named == {path.stem for path in (ROOT / "ntc" / "codec").glob("*.py")} - {"__init__"}


def test_nothing_outside_of_a_codec_imports_it() -> None:
    graph = grimp.build_graph("ntc", cache_dir=None)
    found = {}
    for folder in (f"ntc.codec.{name}" for name in MODULES):
        inside = {folder, *graph.find_descendants(folder)}
        importers = {each for module in inside for each in graph.find_modules_that_directly_import(module)} - inside
        if others := sorted(importers - CHOICES_OF_THE_USER):
            found[folder] = others
    assert found == {}


WRAPS: tuple[WrapMode, ...] = ("repeat", "mirror", "clamp")
SHAPES = ((64, 64, 3), (17, 33, 1), (1, 1, 2), (8, 5, 4))
GROUPS = (0, 1, 0, 1)


@pytest.fixture(scope="module")
def codec() -> Iterator[Codec]:
    """The codec of tests, from here on in this file."""
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
    ended = Trainer(checked_request(request), host, snapshots=host).run()
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
    with pytest.raises(InputError, match=f"codec {NAME} cannot encode with the decoders of another pack"):
        codec.encode_with_decoders(TEXTURES, encoded(TEXTURES, GROUPS), codec.options_for(EncodingChoices()))
