"""Encoding by jobs: the same packs in any order and after any stop, what cannot be read, and what a plan is made of."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from ntc.codec.config import GroupingConfig, GroupingName
from ntc.codec.encoding import BitsTarget, EncodingChoices
from ntc.codec.registry import CodecName, codec_of
from ntc.errors import InputError
from ntc.library.index import Library, library_packs
from ntc.pack.file import write_pack
from tests.support.shuffled_workers import ShuffledWorkers
from viewer.encoding import whole_run as plan
from viewer.encoding.whole_run import EncodeRequest, RunResult, encode_to_library
from viewer.encoding.work import EncodeJob, ReadOptions, WorkJob, WorkResult, texture_refs, work
from viewer.jobs import executor
from viewer.scene.images import write_png

CHUNK = 3


@pytest.fixture(autouse=True)
def _small_jobs(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(plan, "MOST_TEXTURES", CHUNK)
    monkeypatch.setattr(executor, "SECONDS_BETWEEN_QUESTIONS", 0.01)
    threads = torch.get_num_threads()
    yield
    # Workers, which these tests stand for, keep to one.
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten pictures in two categories, one with alpha; one twice, and one of a single colour."""
    place = tmp_path_factory.mktemp("pictures")
    y, x = np.mgrid[0:24, 0:32]
    for number in range(10):
        random_numbers = np.random.default_rng(number)
        waves = [np.sin(x * random_numbers.random() + y * 0.2 + c) * 90 + 128 for c in range(4 if number == 7 else 3)]
        path = place / "ab"[number % 2] / f"{number}.png"
        path.parent.mkdir(exist_ok=True)
        write_png(path, np.stack(waves, -1).astype(np.uint8))
    (place / "b" / "copy.png").write_bytes((place / "a" / "2.png").read_bytes())
    write_png(place / "grey.png", np.full((8, 8, 3), 77, np.uint8))
    return place


Workers = ShuffledWorkers[WorkJob, WorkResult]


def in_order(seed: int, slots: int, fails: Callable[[WorkJob], bool] = lambda _job: False) -> Workers:
    """Workers that do all jobs but those that fail."""

    def done(job: WorkJob) -> WorkResult:
        if fails(job):
            raise InputError("its machine is gone")
        return work(job)

    return ShuffledWorkers(done, seed, slots)


def asked(grouping: GroupingName = "universal", codec: CodecName = "block", **of_grouping: object) -> EncodeRequest:
    choices = EncodingChoices(steps=2, levels=1) if codec == "grid" else EncodingChoices(target=BitsTarget(2.0))
    config = GroupingConfig(grouping, **of_grouping)  # type: ignore[arg-type]
    return EncodeRequest(ReadOptions(), config, codec, choices)


def encoded(source: Path, out: Path, what: EncodeRequest, workers: Workers) -> RunResult:
    return encode_to_library(what, texture_refs(source, "base"), workers.workers, out)


def packs(library: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in library.glob("*.ntc")}


@pytest.mark.parametrize(
    "what",
    [asked(), asked("baseline"), asked("clustered", clusters=2), asked("category", "grid")],
    ids=["universal", "baseline", "clustered", "grid"],
)
def test_any_order_and_number_of_workers_gives_the_same_bytes(
    what: EncodeRequest, folder: Path, tmp_path: Path
) -> None:
    first = encoded(folder, tmp_path / "0", what, in_order(0, 1))
    assert (first.asked, first.constant, first.repeated, first.encoded) == (12, 1, 1, 10)
    assert not first.failed
    assert sorted(each.ref.name for each in first.stored) == [
        f"{'ab'[n % 2]}/{n}" for n in (*range(0, 10, 2), *range(1, 10, 2))
    ]
    assert not list(Library(tmp_path / "0").problems())
    encoded(folder, tmp_path / "2", what, in_order(2, 5))
    assert packs(tmp_path / "2") == packs(tmp_path / "0")


def test_a_run_that_is_stopped_at_any_moment_goes_on_where_it_was(folder: Path, tmp_path: Path) -> None:
    encoded(folder, tmp_path / "whole", asked(), in_order(0, 1))
    whole, library, done = packs(tmp_path / "whole"), tmp_path / "stopped", 0
    refs = texture_refs(folder, "base")
    for _ in range(20):
        workers, before = in_order(3, 1), len(packs(library))
        result = encode_to_library(asked(), refs, workers.workers, library, stopped=lambda: len(workers.jobs) >= 1)  # noqa: B023
        assert set(packs(library)) <= set(whole)
        own = [job for job in workers.jobs if isinstance(job, EncodeJob)]
        assert len(packs(library)) - before == len(own)
        done += result.encoded
        if not workers.jobs:
            break
    assert packs(library) == whole
    assert done == 10


def test_what_is_there_is_not_encoded_again_and_changed_images_are(folder: Path, tmp_path: Path) -> None:
    own = tmp_path / "pictures"
    for path in folder.rglob("*.png"):
        target = own / path.relative_to(folder)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(path.read_bytes())
    encoded(own, tmp_path / "library", asked(), in_order(0, 1))
    write_png(own / "a" / "4.png", np.random.default_rng(0).integers(0, 255, (16, 16, 3), np.uint8))
    workers = in_order(0, 1)
    result = encoded(own, tmp_path / "library", asked(), workers)
    assert [[ref.name for ref in job.refs] for job in workers.jobs if not isinstance(job, EncodeJob)] == [["a/4"]]
    assert [[each.ref.name for each in job.textures] for job in workers.jobs if isinstance(job, EncodeJob)] == [["a/4"]]
    assert (result.encoded, len(result.stored)) == (1, 10)
    (pack, *_) = library_packs(tmp_path / "library", {each.texture.pixel_hash for each in result.stored})
    assert len(pack.textures) == 9


def test_images_that_lie_are_tried_three_times_and_named(folder: Path, tmp_path: Path) -> None:
    own = tmp_path / "pictures"
    own.mkdir()
    for number, path in enumerate(sorted(folder.rglob("*.png"))[:6]):
        (own / f"{number}.png").write_bytes(path.read_bytes())
    data = (own / "1.png").read_bytes()
    (own / "1.png").write_bytes(data[: len(data) // 2])
    # The header names other sides than the pixels have.
    (own / "3.png").write_bytes(data[:16] + (30000).to_bytes(4) + (30000).to_bytes(4) + data[24:])
    result = encoded(own, tmp_path / "library", asked(), in_order(0, 2))
    assert sorted(Path(path).name for path in result.failed) == ["1.png", "3.png"]
    assert result.encoded == 4
    # Six, three with each bad one, that one with another one, and alone: each is tried again twice, and then cut.
    assert result.tried_again == 3 + 2 * (3 + 2) + 3


def test_an_image_that_changes_after_it_was_looked_at_is_named(folder: Path, tmp_path: Path) -> None:
    own = tmp_path / "pictures"
    own.mkdir()
    for number in range(3):
        (own / f"{number}.png").write_bytes((folder / "a" / f"{number * 2}.png").read_bytes())

    def change(job: WorkJob) -> bool:
        if isinstance(job, EncodeJob):
            write_png(own / "1.png", np.random.default_rng(0).integers(0, 255, (16, 16, 3), np.uint8))
        return False

    result = encoded(own, tmp_path / "library", asked(), in_order(0, 1, change))
    assert [Path(path).name for path in result.failed] == ["1.png"]
    assert "has changed since it was read" in next(iter(result.failed.values()))
    assert result.encoded == 2


def test_a_full_disk_ends_the_run_and_the_next_one_goes_on(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add, calls = Library.add, list[str]()

    def full(self: Library, data: bytes) -> bool:
        calls.append("add")
        if len(calls) == 2:
            raise InputError("a.ntc: cannot be written (No space left on device); check space and permissions")
        return add(self, data)

    monkeypatch.setattr(Library, "add", full)
    with pytest.raises(InputError, match="No space left"):
        encoded(folder, tmp_path / "library", asked(), in_order(0, 1))
    assert len(packs(tmp_path / "library")) == 1
    after = encoded(folder, tmp_path / "library", asked(), in_order(0, 1))
    assert (after.encoded, len(after.stored)) == (10 - CHUNK, 10)


def test_what_no_worker_survives_is_named_alone(folder: Path, tmp_path: Path) -> None:
    # Its job is cut until it is alone.
    lost = in_order(0, 1, lambda job: isinstance(job, EncodeJob) and "a/0" in [each.ref.name for each in job.textures])
    result = encoded(folder, tmp_path / "library", asked(), lost)
    assert [(Path(path).name, why) for path, why in result.failed.items()] == [("0.png", "its machine is gone")]
    assert (result.encoded, result.tried_again) == (9, 5)
    # Once the machine is back, what is missing is done.
    after = encoded(folder, tmp_path / "library", asked(), in_order(0, 1))
    assert (after.encoded, len(after.stored)) == (1, 10)


def test_new_textures_take_decoders_of_a_pack_with_any_number_of_workers(folder: Path, tmp_path: Path) -> None:
    encoded(folder / "b", tmp_path / "old", asked("clustered", clusters=2), in_order(0, 1))
    # Textures with alpha have a codec of their own.
    known = max(library_packs(tmp_path / "old"), key=lambda pack: len(pack.textures))
    write_pack(tmp_path / "known.ntc", known)
    what = replace(asked(), decoders=tmp_path / "known.ntc")
    results = [encoded(folder / "a", tmp_path / str(seed), what, in_order(seed, seed + 1)) for seed in range(3)]
    assert [(each.encoded, each.failed) for each in results] == [(5, {})] * 3
    assert packs(tmp_path / "0") == packs(tmp_path / "1") == packs(tmp_path / "2")
    codec = codec_of(known.config)
    old = [codec.decoder_tensors(decoder, known.config) for decoder in known.decoders]
    (found,) = library_packs(tmp_path / "0")
    assert found.config == known.config
    for decoder in found.decoders:
        tensors = codec.decoder_tensors(decoder, known.config)
        assert any(all(np.array_equal(tensors[name], each[name]) for name in tensors) for each in old)
    # They are of one settings key, so that a scene opens with both.
    for data in packs(tmp_path / "old").values():
        Library(tmp_path / "0").add(data)
    hashes = {texture.pixel_hash for texture in (*found.textures, *known.textures)}
    assert max(len(pack.textures) for pack in library_packs(tmp_path / "0")) == len(hashes) == 9


def test_lists_and_groupings_are_refused_in_one_line(folder: Path, tmp_path: Path) -> None:
    listed = tmp_path / "list.txt"
    listed.write_text(f"# pictures\n{folder}/a/0.png\n\n{folder}/a/2.png\n{folder}/a/0.png\n")
    assert [ref.path for ref in texture_refs(listed, "base")] == [f"{folder}/a/0.png", f"{folder}/a/2.png"]
    listed.write_text("notes.doc\n")
    with pytest.raises(InputError, match=r"notes\.doc: write paths of images"):
        texture_refs(listed, "base")
    with pytest.raises(InputError, match="--grouping covisible: cannot be encoded by jobs"):
        encoded(folder, tmp_path / "library", asked("covisible"), in_order(0, 1))
    assert not Library(tmp_path / "library").packs
