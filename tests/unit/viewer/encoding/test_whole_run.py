"""Encoding by jobs: the same shards in any order and after any stop, what cannot be read, and what a plan is made of."""

import random
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
import torch

from ntc.codec.config import GroupingConfig, GroupingName
from ntc.codec.encoding import BitsTarget, EncodingChoices
from ntc.codec.registry import CodecName
from ntc.errors import InputError
from ntc.library.index import SHARDS_FOLDER, read_index
from ntc.library.reading import library_packs
from ntc.library.writer import LibraryWriter, problems
from viewer.encoding import whole_run as plan
from viewer.encoding.whole_run import Asked, RunResult, encode_to_library
from viewer.encoding.work import EncodeJob, Reading, WorkJob, WorkResult, texture_refs, work
from viewer.jobs.executor import Ended
from viewer.scene.images import write_png

CHUNK = 3


@pytest.fixture(autouse=True)
def _small_jobs(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(plan, "MOST_TEXTURES", CHUNK)
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


class InOrder:
    """An executor in the caller's own thread, whose jobs end in an order that `seed` decides."""

    def __init__(self, seed: int, slots: int, fails: Callable[[WorkJob], bool] = lambda _job: False) -> None:
        self.slots, self.jobs = slots, list[WorkJob]()
        self._fails, self._random, self._waiting = fails, random.Random(seed), dict[int, WorkJob]()

    def submit(self, number: int, argument: WorkJob) -> None:
        self._waiting[number] = argument

    def wait(self, seconds: float) -> Sequence[Ended[WorkResult]]:
        number = self._random.choice(sorted(self._waiting))
        job = self._waiting.pop(number)
        self.jobs.append(job)
        return [Ended(number, None, "its machine is gone") if self._fails(job) else Ended(number, work(job))]

    def close(self) -> None:
        pass


def asked(grouping: GroupingName = "universal", codec: CodecName = "block", **of_grouping: object) -> Asked:
    choices = EncodingChoices(steps=2, levels=1) if codec == "grid" else EncodingChoices(target=BitsTarget(2.0))
    config = GroupingConfig(grouping, **of_grouping)  # type: ignore[arg-type]
    return Asked(Reading(), config, codec, choices)


def encoded(source: Path, out: Path, what: Asked, executor: InOrder) -> RunResult:
    return encode_to_library(what, texture_refs(source, "base"), executor, out)


def shards(library: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (library / SHARDS_FOLDER).iterdir()}


@pytest.mark.parametrize(
    "what",
    [asked(), asked("baseline"), asked("clustered", clusters=2), asked("category", "grid")],
    ids=["universal", "baseline", "clustered", "grid"],
)
def test_any_order_and_number_of_workers_gives_the_same_bytes(what: Asked, folder: Path, tmp_path: Path) -> None:
    first = encoded(folder, tmp_path / "0", what, InOrder(0, 1))
    assert (first.asked, first.constant, first.repeated, first.encoded) == (12, 1, 1, 10)
    assert not first.failed
    assert sorted(each.ref.name for each in first.stored) == [
        f"{'ab'[n % 2]}/{n}" for n in (*range(0, 10, 2), *range(1, 10, 2))
    ]
    assert not list(problems(tmp_path / "0"))
    for seed, slots in ((1, 2), (2, 5)):
        encoded(folder, tmp_path / str(seed), what, InOrder(seed, slots))
        assert shards(tmp_path / str(seed)) == shards(tmp_path / "0")


def test_a_run_that_is_stopped_at_any_moment_goes_on_where_it_was(folder: Path, tmp_path: Path) -> None:
    encoded(folder, tmp_path / "whole", asked(), InOrder(0, 1))
    whole, library, done = shards(tmp_path / "whole"), tmp_path / "stopped", 0
    refs = texture_refs(folder, "base")
    for _ in range(20):
        executor, before = InOrder(3, 1), len(shards(library)) if library.exists() else 0
        result = encode_to_library(asked(), refs, executor, library, stopped=lambda: len(executor.jobs) >= 1)  # noqa: B023
        assert set(shards(library)) <= set(whole)
        own = [job for job in executor.jobs if isinstance(job, EncodeJob)]
        assert len(shards(library)) - before == len(own)
        done += result.encoded
        if not executor.jobs:
            break
    assert shards(library) == whole
    assert done == 10


def test_what_is_there_is_not_encoded_again_and_changed_images_are(folder: Path, tmp_path: Path) -> None:
    own = tmp_path / "pictures"
    for path in folder.rglob("*.png"):
        target = own / path.relative_to(folder)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(path.read_bytes())
    encoded(own, tmp_path / "library", asked(), InOrder(0, 1))
    write_png(own / "a" / "4.png", np.random.default_rng(0).integers(0, 255, (16, 16, 3), np.uint8))
    executor = InOrder(0, 1)
    result = encoded(own, tmp_path / "library", asked(), executor)
    assert [[ref.name for ref in job.refs] for job in executor.jobs if not isinstance(job, EncodeJob)] == [["a/4"]]
    assert [[each.ref.name for each in job.textures] for job in executor.jobs if isinstance(job, EncodeJob)] == [
        ["a/4"]
    ]
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
    executor = InOrder(0, 2)
    result = encoded(own, tmp_path / "library", asked(), executor)
    assert sorted(Path(path).name for path in result.failed) == ["1.png", "3.png"]
    assert result.encoded == 4
    assert [len(job.refs) for job in executor.jobs if not isinstance(job, EncodeJob)] == [6, 6, 6, 4]


def test_an_image_that_changes_after_it_was_looked_at_is_named(folder: Path, tmp_path: Path) -> None:
    own = tmp_path / "pictures"
    own.mkdir()
    for number in range(3):
        (own / f"{number}.png").write_bytes((folder / "a" / f"{number * 2}.png").read_bytes())

    def change(job: WorkJob) -> bool:
        if isinstance(job, EncodeJob):
            write_png(own / "1.png", np.random.default_rng(0).integers(0, 255, (16, 16, 3), np.uint8))
        return False

    result = encoded(own, tmp_path / "library", asked(), InOrder(0, 1, change))
    assert [Path(path).name for path in result.failed] == ["1.png"]
    assert "has changed since it was looked at" in next(iter(result.failed.values()))
    assert result.encoded == 2


def test_a_full_disk_costs_another_try_and_what_no_worker_survives_is_named_alone(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add, calls = LibraryWriter.add, list[str]()

    def full(self: LibraryWriter, shard: object, data: bytes) -> bool:
        calls.append("add")
        if len(calls) == 2:
            raise InputError("shards: cannot be written (No space left on device); check space and permissions")
        return add(self, shard, data)  # type: ignore[arg-type]

    monkeypatch.setattr(LibraryWriter, "add", full)
    # A texture that no worker survives: its job is cut until it is alone.
    lost = InOrder(0, 1, lambda job: isinstance(job, EncodeJob) and "a/0" in [each.ref.name for each in job.textures])
    result = encoded(folder, tmp_path / "library", asked(), lost)
    assert [(Path(path).name, why) for path, why in result.failed.items()] == [("0.png", "its machine is gone")]
    assert result.encoded == 9
    assert result.tried_again == 6
    assert not list(problems(tmp_path / "library"))
    # Once the machine is back, what is missing is done.
    after = encoded(folder, tmp_path / "library", asked(), InOrder(0, 1))
    assert (after.encoded, len(after.stored)) == (1, 10)


def test_lists_and_groupings_are_refused_in_one_line(folder: Path, tmp_path: Path) -> None:
    listed = tmp_path / "list.txt"
    listed.write_text(f"# pictures\n{folder}/a/0.png\n\n{folder}/a/2.png\n{folder}/a/0.png\n")
    assert [ref.path for ref in texture_refs(listed, "base")] == [f"{folder}/a/0.png", f"{folder}/a/2.png"]
    listed.write_text("notes.doc\n")
    with pytest.raises(InputError, match=r"notes\.doc: write paths of images"):
        texture_refs(listed, "base")
    with pytest.raises(InputError, match="--grouping covisible: cannot be encoded by jobs"):
        encoded(folder, tmp_path / "library", asked("covisible"), InOrder(0, 1))
    assert not read_index(tmp_path / "library").shards
