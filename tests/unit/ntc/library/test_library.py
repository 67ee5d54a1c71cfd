"""A library of shards: what was added is there whatever happens, what is damaged is found, and only what is wanted is read."""

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.model import Pack
from ntc.codec.reference import decode_image
from ntc.errors import InputError
from ntc.library import writer as writing
from ntc.library.index import INDEX_FILE, SHARDS_FOLDER, Record, read_index, record_line
from ntc.library.reading import library_packs
from ntc.library.writer import LibraryWriter, compact, problems
from ntc.pack.file import pack_bytes, read_pack, read_textures, write_pack

SIZES = ((16, 16), (24, 8))


def names(first: int) -> list[str]:
    """Pixel hashes."""
    return [hashlib.sha256(str(first + number).encode()).hexdigest()[:32] for number in range(len(SIZES))]


def small_pack(seed: int) -> Pack:
    """Two textures of their own, in two groups."""
    return random_pack(SIZES, (0, 1), hashes=names(2 * seed), seed=seed)


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """Three packs of two textures."""
    folder = tmp_path / "library"
    with LibraryWriter(folder) as writer:
        for seed in range(3):
            assert writer.add_pack(small_pack(seed))
    return folder


def assert_holds(folder: Path, packs: list[Pack]) -> None:
    """The library in `folder` gives the textures of `packs` as they are."""
    for pack in packs:
        wanted = {texture.pixel_hash for texture in pack.textures}
        (found,) = library_packs(folder, wanted)
        assert {texture.pixel_hash for texture in found.textures} == wanted
        for index, texture in enumerate(pack.textures):
            place = [own.pixel_hash for own in found.textures].index(texture.pixel_hash)
            assert np.array_equal(decode_image(found, place), decode_image(pack, index))


def content(folder: Path) -> dict[str, bytes]:
    """All that the library consists of."""
    shards = {path.name: path.read_bytes() for path in (folder / SHARDS_FOLDER).iterdir()}
    return {INDEX_FILE: (folder / INDEX_FILE).read_bytes(), **shards}


def test_what_was_added_is_read_back(library: Path) -> None:
    assert_holds(library, [small_pack(seed) for seed in range(3)])
    assert list(problems(library)) == []
    # One texture of each of two shards: one pack, and nothing of the third.
    first, second = small_pack(0).textures[1], small_pack(2).textures[0]
    (found,) = library_packs(library, {first.pixel_hash, second.pixel_hash})
    assert [texture.pixel_hash for texture in found.textures] == [first.pixel_hash, second.pixel_hash]
    assert len(found.decoders) == 2
    assert library_packs(library, {"f" * 32}) == []


def test_what_is_there_is_not_added_again(library: Path) -> None:
    before = content(library)
    with LibraryWriter(library) as writer:
        assert not writer.add_pack(small_pack(1))
    assert content(library) == before


def test_the_same_packs_give_the_same_bytes(library: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    with LibraryWriter(again) as writer:
        for seed in range(3):
            writer.add_pack(small_pack(seed))
    assert content(again) == content(library)


def test_other_settings_are_kept_apart(library: Path) -> None:
    block = random_block_pack(SIZES, (0, 0), hashes=names(0))
    with LibraryWriter(library) as writer:
        assert writer.add_pack(block)
    packs = library_packs(library, set(names(0)))
    assert sorted(pack.config.kind for pack in packs) == ["block", "grid"]


def test_an_index_cut_anywhere_opens_with_what_was_whole(library: Path) -> None:
    whole = (library / INDEX_FILE).read_bytes()
    ends = [place + 1 for place, byte in enumerate(whole) if byte == ord("\n")]
    for length in range(ends[0], len(whole) + 1):
        (library / INDEX_FILE).write_bytes(whole[:length])
        index = read_index(library)
        assert len(index.shards) == sum(end <= length for end in ends) - 1
        assert index.damaged_lines == []
    (library / INDEX_FILE).write_bytes(whole[: ends[1] + 7])
    with LibraryWriter(library) as writer:
        # The shards are there; only what the index says of them was lost.
        assert writer.add_pack(small_pack(1))
        assert writer.add_pack(small_pack(2))
    assert content(library)[INDEX_FILE] == whole


def test_a_process_that_ends_at_any_step_loses_nothing_acknowledged(
    library: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Steps: the file of the shard, and half of the line of the index."""

    class EndedError(Exception):
        pass

    def end(*_arguments: object) -> None:
        raise EndedError

    def half_a_line(_writer: LibraryWriter, record: Record) -> None:
        path = library / INDEX_FILE
        line = record_line(record)
        path.write_bytes(path.read_bytes() + line[: len(line) // 2])
        raise EndedError

    steps: list[tuple[object, str, Callable[..., None]]] = [
        (writing, "write_bytes", end),
        (LibraryWriter, "_append", half_a_line),
    ]
    for owner, name, step in steps:
        with monkeypatch.context() as patched:
            patched.setattr(owner, name, step)
            with pytest.raises(EndedError), LibraryWriter(library) as writer:
                writer.add_pack(small_pack(3))
        assert_holds(library, [small_pack(seed) for seed in range(3)])
    with LibraryWriter(library) as writer:
        writer.add_pack(small_pack(3))
    assert list(problems(library)) == []
    assert_holds(library, [small_pack(seed) for seed in range(4)])


def test_only_one_process_adds(library: Path) -> None:
    with LibraryWriter(library), pytest.raises(InputError, match="another process"):
        LibraryWriter(library)


def test_a_folder_of_other_things_is_refused(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="holds other files"):
        LibraryWriter(tmp_path)
    with pytest.raises(InputError, match="holds no library"):
        read_index(tmp_path)


def test_every_flipped_bit_is_found(library: Path) -> None:
    random = np.random.default_rng(3)
    assert list(problems(library)) == []
    for path in [library / INDEX_FILE, *(library / SHARDS_FOLDER).iterdir()]:
        data = path.read_bytes()
        for place in random.choice(len(data), 40, replace=False):
            spoilt = bytearray(data)
            spoilt[place] ^= 1 << random.integers(0, 8)
            path.write_bytes(bytes(spoilt))
            assert list(problems(library)), (path.name, place)
        path.write_bytes(data)
    assert list(problems(library)) == []


def test_compacting_joins_shards_and_leaves_damaged_ones_out(library: Path) -> None:
    (shard,) = [
        read_index(library).path(own)
        for own in read_index(library).shards.values()
        if own.textures[0].pixel_hash == names(2)[0]
    ]
    shard.write_bytes(shard.read_bytes()[:-1])
    with LibraryWriter(library) as writer:
        result = compact(writer)
    assert (result.shards_before, result.shards, result.textures) == (3, 1, 4)
    assert len(result.dropped) == 1
    assert len(list((library / SHARDS_FOLDER).iterdir())) == 1
    assert list(problems(library)) == []
    assert_holds(library, [small_pack(0), small_pack(2)])


def test_joined_shards_stay_within_their_limit(library: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second, _ = (path.stat().st_size for path in sorted((library / SHARDS_FOLDER).iterdir()))
    monkeypatch.setattr(writing, "LARGEST_JOINED", first + second)
    with LibraryWriter(library) as writer:
        result = compact(writer)
    assert (result.shards_before, result.shards, result.textures) == (3, 2, 6)
    assert_holds(library, [small_pack(seed) for seed in range(3)])


def test_a_compaction_that_is_stopped_loses_nothing(library: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class EndedError(Exception):
        pass

    def end(*_arguments: object) -> None:
        raise EndedError

    for name in ("add_file", "replace_index"):
        with monkeypatch.context() as patched:
            patched.setattr(LibraryWriter, name, end)
            with pytest.raises(EndedError), LibraryWriter(library) as writer:
                compact(writer)
        assert_holds(library, [small_pack(seed) for seed in range(3)])


@pytest.mark.parametrize("make", [random_pack, random_block_pack])
def test_reading_some_textures_gives_what_reading_all_does(make: Callable[[], Pack], tmp_path: Path) -> None:
    path = tmp_path / "whole.ntc"
    write_pack(path, make())
    whole = read_pack(path)
    for index, texture in enumerate(whole.textures):
        part = read_textures(path, {texture.pixel_hash})
        assert len(part.textures) == len(part.decoders) == 1
        assert np.array_equal(decode_image(part, 0), decode_image(whole, index))
    with pytest.raises(InputError, match="none of the wanted textures"):
        read_textures(path, {"0"})


def test_damaged_files_are_refused_in_a_line(tmp_path: Path) -> None:
    pack, random, path = small_pack(0), np.random.default_rng(7), tmp_path / "spoilt.ntc"
    data, wanted = pack_bytes(pack), {pack.textures[0].pixel_hash}
    told = list[str]()
    for number in range(300):
        spoilt = bytearray(data)
        for place in random.integers(0, 2500, 3):
            spoilt[place] = random.integers(0, 256)
        path.write_bytes(bytes(spoilt) if number % 5 else data[: random.integers(0, len(data))])
        try:
            read_textures(path, wanted)
        except InputError as error:
            told.append(str(error))
    assert len(told) > 200
    assert not [line for line in told if "\n" in line]
