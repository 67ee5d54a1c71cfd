"""A library is a folder of packs: its index is made again from them, what is damaged is found, and only what is wanted is read."""

import hashlib
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.model import Pack
from ntc.codec.reference import decode_image
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.library.index import INDEX_FILE, Library, is_library, library_packs
from ntc.library.joining import joined_pack
from ntc.pack.file import pack_bytes, read_pack, read_textures, write_pack

SIZES = ((16, 16), (24, 8))


def names(first: int) -> list[str]:
    """Pixel hashes."""
    return [hashlib.sha256(str(first + number).encode()).hexdigest()[:32] for number in range(len(SIZES))]


def small_pack(seed: int) -> Pack:
    """Two textures of their own, in two groups."""
    return random_pack(SIZES, (0, 1), hashes=names(2 * seed), seed=seed)


def filled(folder: Path, seeds: tuple[int, ...] = (0, 1, 2)) -> Path:
    """A library of packs of two textures."""
    library = Library.to_write(folder)
    for seed in seeds:
        assert library.add(pack_bytes(small_pack(seed)))
    library.save()
    return folder


@pytest.fixture
def library(tmp_path: Path) -> Path:
    return filled(tmp_path / "library")


def assert_holds(folder: Path, packs: list[Pack]) -> None:
    """The library in `folder` gives the textures of `packs` as they are."""
    for pack in packs:
        wanted = {texture.pixel_hash for texture in pack.textures}
        (found,) = library_packs(folder, wanted)
        assert {texture.pixel_hash for texture in found.textures} == wanted
        for index, texture in enumerate(pack.textures):
            place = [each.pixel_hash for each in found.textures].index(texture.pixel_hash)
            assert np.array_equal(decode_image(found, place), decode_image(pack, index))


def content(folder: Path) -> dict[str, bytes]:
    """The files of the packs."""
    return {path.name: path.read_bytes() for path in folder.glob("*.ntc")}


def test_what_was_added_is_read_back(library: Path) -> None:
    assert_holds(library, [small_pack(seed) for seed in range(3)])
    assert list(Library(library).problems()) == []
    # One texture of each of two packs: one pack, and nothing of the third.
    first, second = small_pack(0).textures[1], small_pack(2).textures[0]
    (found,) = library_packs(library, {first.pixel_hash, second.pixel_hash})
    assert {texture.pixel_hash for texture in found.textures} == {first.pixel_hash, second.pixel_hash}
    assert len(found.decoders) == 2
    assert library_packs(library, {"f" * 32}) == []
    (everything,) = library_packs(library)
    assert len(everything.textures) == 6


@pytest.mark.parametrize("make", [random_pack, random_block_pack])
def test_the_header_tells_what_a_texture_is(make: Callable[[], Pack], tmp_path: Path) -> None:
    pack = make()
    library = Library.to_write(tmp_path / "library")
    library.add(pack_bytes(pack))
    ((_, stored),) = [each for each in library.textures.values() if each[1].name == pack.textures[1].name]
    texture, sizes = pack.textures[1], codec_of(pack.config).texture_bytes(pack.textures[1], pack.config)
    assert (stored.width, stored.height, stored.pixel_hash) == (texture.width, texture.height, texture.pixel_hash)
    assert stored.bits_per_texel == 8.0 * (sizes.latents + sizes.constants) / (texture.width * texture.height)


def test_any_order_of_adding_gives_the_same_packs_and_none_twice(library: Path, tmp_path: Path) -> None:
    assert content(filled(tmp_path / "again", (2, 0, 1))) == content(library)
    before = content(library)
    assert not Library.to_write(library).add(pack_bytes(small_pack(1)))
    assert content(library) == before


def test_other_settings_are_kept_apart(library: Path) -> None:
    assert Library(library).add(pack_bytes(random_block_pack(SIZES, (0, 0), hashes=names(0))))
    packs = library_packs(library, set(names(0)))
    assert sorted(pack.config.kind for pack in packs) == ["block", "grid"]


def test_packs_may_be_copied_replaced_and_deleted_by_hand(library: Path) -> None:
    own = library / "street" / "street.clustered.ntc"
    own.parent.mkdir()
    write_pack(own, small_pack(3))
    assert_holds(library, [small_pack(0), small_pack(3)])
    write_pack(own, random_pack((*SIZES, (8, 8)), (0, 1, 0), hashes=[*names(8), "a" * 32], seed=4))
    assert library_packs(library, set(names(6))) == []
    assert_holds(library, [small_pack(1)])
    shutil.rmtree(own.parent)
    assert library_packs(library, set(names(8))) == []
    assert len(Library(library).packs) == 3


def test_an_index_that_is_missing_cut_or_damaged_is_made_again(library: Path) -> None:
    whole, random = (library / INDEX_FILE).read_bytes(), np.random.default_rng(3)
    packs = Library(library).packs
    spoilt = [whole[: len(whole) * part // 8] for part in range(8)]
    for place in random.choice(len(whole), 15, replace=False):
        flipped = bytearray(whole)
        flipped[place] ^= 1 << random.integers(0, 8)
        spoilt.append(bytes(flipped))
    for data in spoilt:
        (library / INDEX_FILE).write_bytes(data)
        assert Library(library).packs == packs
        assert (library / INDEX_FILE).read_bytes() == whole, "written again"
    (library / INDEX_FILE).unlink()
    assert is_library(library)
    assert_holds(library, [small_pack(seed) for seed in range(3)])


def test_a_process_that_ends_at_any_step_loses_no_pack(library: Path) -> None:
    # Killed while it wrote a pack, and before it wrote the index.
    (library / ".0123.partial.ntc").write_bytes(pack_bytes(small_pack(4))[:100])
    assert Library(library).add(pack_bytes(small_pack(3)))
    found = Library(library)
    assert (len(found.packs), found.unreadable) == (4, {})
    assert_holds(library, [small_pack(seed) for seed in range(4)])


def test_two_processes_may_add_at_the_same_time(library: Path) -> None:
    first, second = Library.to_write(library), Library.to_write(library)
    assert first.add(pack_bytes(small_pack(3)))
    assert second.add(pack_bytes(small_pack(4)))
    assert second.add(pack_bytes(small_pack(3)))
    second.save()
    first.save()
    assert_holds(library, [small_pack(seed) for seed in range(5)])
    assert len(Library(library).packs) == 5


def test_a_folder_of_other_things_is_refused(tmp_path: Path) -> None:
    write_pack(tmp_path / "street.ntc", small_pack(0))
    (tmp_path / "street.glb").write_bytes(b"glTF")
    assert not is_library(tmp_path)
    with pytest.raises(InputError, match="holds other files"):
        Library.to_write(tmp_path)
    with pytest.raises(InputError, match="holds no library"):
        Library(tmp_path)


def test_a_library_of_version_1_opens(library: Path) -> None:
    """Its packs were in a folder `shards`, its index had a line for each, and `lock` was beside it."""
    (library / "shards").mkdir()
    for path in library.glob("*.ntc"):
        path.rename(library / "shards" / path.name)
    (library / INDEX_FILE).write_bytes(b'0123456789abcdef {"library":{"version":1}}\n')
    (library / "lock").touch()
    assert_holds(library, [small_pack(seed) for seed in range(3)])
    assert list(Library(library).problems()) == []


def test_every_flipped_bit_is_found_and_what_is_no_pack_is_left_out(library: Path) -> None:
    random = np.random.default_rng(3)
    for path in library.glob("*.ntc"):
        data = path.read_bytes()
        for place in random.choice(len(data), 15, replace=False):
            spoilt = bytearray(data)
            spoilt[place] ^= 1 << random.integers(0, 8)
            path.write_bytes(bytes(spoilt))
            assert list(Library(library).problems()), (path.name, place)
        path.write_bytes(data)
    assert list(Library(library).problems()) == []
    (library / "torn.ntc").write_bytes(data[: len(data) // 2])
    (problem,) = Library(library).problems()
    assert "torn.ntc" in problem
    assert_holds(library, [small_pack(seed) for seed in range(3)])


def test_packs_with_the_same_decoders_share_them_where_they_are_joined() -> None:
    first = small_pack(0)
    second = replace(small_pack(1), decoders=first.decoders[::-1])
    joined = joined_pack([first, second])
    assert len(joined.decoders) == 2
    assert joined.grouping.groups == (0, 1, 1, 0)
    for index in range(2):
        assert np.array_equal(decode_image(joined, 2 + index), decode_image(second, index))


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
    errors = list[str]()
    for number in range(300):
        spoilt = bytearray(data)
        for place in random.integers(0, 2500, 3):
            spoilt[place] = random.integers(0, 256)
        path.write_bytes(bytes(spoilt) if number % 5 else data[: random.integers(0, len(data))])
        try:
            read_textures(path, wanted)
        except InputError as error:
            errors.append(str(error))
    assert len(errors) > 200
    assert not [line for line in errors if "\n" in line]
