"""Background training without a process: a stand-in that says what a test has it say, and the messages of whole trainings."""

import math
import socket
from dataclasses import replace
from pathlib import Path

import numpy as np
from ntc.pack.validate import check_pack

from ntc.codec.block.config import BlockConfig
from ntc.codec.encoding import QualityBudget
from ntc.codec.grid.config import GridConfig
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.model import Grouping, Pack
from ntc.codec.settings import CodecSettings
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.pack.schema import metadata_json, parse_metadata
from ntc.training.progress import Ended, GroupOutcome, TrainingProgress
from ntc.training.request import TrainingRequest
from ntc.training.snapshot import GroupSnapshot, apply_snapshot
from ntc.worker.client import TrainingWorker, starting_pack
from ntc.worker.pipe import framed
from ntc.worker.protocol import (
    Command,
    Failed,
    Finished,
    Paused,
    Ready,
    Received,
    Report,
    Resumed,
    StartTraining,
    WorkerReport,
    decode_command,
    encode,
)
from ntc.worker.shared_arrays import BLOCK_NAME, SharedBlock, without_arrays
from viewer.training.run_log import Curves

CODEC = GridConfig(
    hidden_width=4, latent_bits=4, positional_octaves=1, output_channels=3, adapters=True, adapter_output=True
)
BLOCK_CODEC = BlockConfig(block_words=(4,), coefficients=8, modes=2)
GIVEN_BLOCK, SNAPSHOT_BLOCK = "ntc-0-" + "0" * 16, "ntc-0-" + "1" * 16
MOST_POLLS = 2000


def small_request(codec: CodecSettings = CODEC) -> TrainingRequest:
    """Three tiny textures in two groups."""
    sizes = ((4, 4, 3), (3, 5, 1), (8, 4, 3))
    textures = tuple(
        SourceTexture(f"t{number}", np.full(size, 40 * number, np.uint8), f"{number}" * 32)
        for number, size in enumerate(sizes)
    )
    return TrainingRequest(textures, Grouping("random", (0, 1, 0)), codec, TrainingConfig(steps=10, device="cpu"))


def snapshots(request: TrainingRequest, version: int = 1, final: bool = True) -> list[GroupSnapshot]:
    """One of each group, without detail, with arrays."""
    pack = starting_pack(replace(request, start=None))
    found = []
    for group in range(request.grouping.group_count):
        members = tuple(index for index, number in enumerate(request.grouping.groups) if number == group)
        textures = tuple(replace(pack.textures[index], psnr_db=20.0 if final else None) for index in members)
        found.append(GroupSnapshot(version, group, members, textures, pack.decoders[group], final))
    return found


def placed(request: TrainingRequest, found: list[GroupSnapshot]) -> list[GroupSnapshot]:
    """Snapshots with places that the window has room for: groups one after the other, as `ntc.worker.client` lays them out."""
    position, places = 0, []
    for snapshot in found:
        here, _, position = without_arrays(snapshot, position)
        places.append(here)
    return places


def progress(step: int = 5) -> TrainingProgress:
    """An ordinary one."""
    return TrainingProgress(step, 10, 1.0, 2.0, {0: 0.1, 1: 0.2}, {0: 10.0, 1: 7.0, 2: 10.0}, 1.0, 3.0)


def whole_training(request: TrainingRequest) -> list[WorkerReport]:
    """What a process says that does all it should."""
    early, final = (placed(request, snapshots(request, 1 + last, bool(last))) for last in (False, True))
    outcomes = tuple(GroupOutcome(snapshot.group, None, 20.0) for snapshot in final)
    ended = Ended("done", outcomes, {"recipe": "best", "steps": 10, "nested": {"groups": [0, 1], "rate": 0.5}})
    return [Ready(), Received(), progress(), Paused(), Resumed(), *early, progress(10), *final, ended]


def stream(reports: list[WorkerReport]) -> bytes:
    """As they go through the pipe."""
    return b"".join(framed(encode(report)) for report in reports)


def starts(codec: CodecSettings = CODEC) -> list[StartTraining]:
    """Orders to train: from nothing, and going on from a pack."""
    plain = small_request(codec)
    pack = starting_pack(plain)
    again = replace(plain, start=pack, dirty=frozenset({1}), budget=QualityBudget(30.0))
    return [
        StartTraining(without_arrays(request)[0], GIVEN_BLOCK, SNAPSHOT_BLOCK, {0: 0, 1: 4096})
        for request in (plain, again)
    ]


class StandIn:
    """In place of the training process. It lives until it is killed or `die` is called."""

    def __init__(self, end: socket.socket, says: bytes = b"", answers: bytes = b"", fill: int | None = None) -> None:
        self._end = end.dup()
        self._end.setblocking(False)
        self._answers = answers
        """What it says to an order to train."""
        self._fill = fill
        """What all bytes of the snapshot block are then set to."""
        self.heard: list[Command] = []
        self.exitcode: int | None = None
        self.say(says)

    @property
    def pid(self) -> int | None:
        """Of no process."""
        return None

    def say(self, data: bytes) -> int:
        """Send bytes as far as the pipe takes them; returns how many."""
        try:
            return self._end.send(data) if data else 0
        except OSError:
            return 0

    def listen(self) -> None:
        """Note the commands that have come; of whole messages only, for the window's own are."""
        data = bytearray()
        try:
            while chunk := self._end.recv(1 << 20):
                data += chunk
        except OSError:
            pass
        while data:
            length = int.from_bytes(data[:4], "little")
            command = decode_command(bytes(data[4 : 4 + length]))
            del data[: 4 + length]
            self.heard.append(command)
            if isinstance(command, StartTraining):
                if self._fill is not None:
                    self._write(command.snapshot_block, self._fill)
                self.say(self._answers)

    def _write(self, name: str, value: int) -> None:
        # Not opened as shared memory, which the standard library would count as this process's.
        path = Path("/dev/shm", name)
        if path.exists():
            path.write_bytes(bytes([value]) * path.stat().st_size)

    def die(self, status: int = 1) -> None:
        """End with a status."""
        if self.exitcode is None:
            self.exitcode = status
            self._end.close()

    def is_alive(self) -> bool:
        """Until its end."""
        return self.exitcode is None

    def kill(self) -> None:
        """As by a signal."""
        self.die(-9)

    def join(self, timeout: float | None = None) -> None:
        """Nothing to wait for."""

    def close(self) -> None:
        """Nothing to give back."""


class Session:
    """A window with stand-ins for processes, used the way the viewer uses it. Whatever it gets must be fit for use."""

    def __init__(self, says: bytes = b"", answers: bytes = b"", fill: int | None = None) -> None:
        self._says, self._answers, self._fill = says, answers, fill
        self.processes: list[StandIn] = []
        self.worker = TrainingWorker(self._launch)
        self.ends: list[Finished | Failed] = []
        self._curves = Curves()
        self._pack: Pack | None = None

    def _launch(self, end: socket.socket) -> StandIn:
        self.processes.append(StandIn(end, self._says, self._answers, self._fill))
        return self.processes[-1]

    def says(self, says: bytes, answers: bytes = b"") -> None:
        """What processes from now on say at once, and to an order to train."""
        self._says, self._answers = says, answers

    def start(self, request: TrainingRequest) -> None:
        """Begin a training."""
        self._pack = starting_pack(request)
        self.worker.start(request)

    def poll(self) -> list[Report]:
        """What the window gets, tried out."""
        reports = self.worker.poll()
        for process in self.processes[-1:]:
            if process.is_alive():
                process.listen()
        for report in reports:
            self._use(report)
        return reports

    def run(self, polls: int = MOST_POLLS) -> None:
        """Poll until the training is over or nothing more comes."""
        silent = 0
        for _ in range(polls):
            silent = 0 if self.poll() else silent + 1
            if not self.worker.busy or silent > 3:
                return

    def _use(self, report: Report) -> None:
        if isinstance(report, TrainingProgress):
            self._curves.add(report)
            shown = (report.seconds_left, report.elapsed_seconds, report.ktexels_per_second, *report.losses.values())
            assert all(0.0 <= number < math.inf for number in shown)
            assert 0 <= report.step <= report.steps
            assert report.note.isprintable()
        elif isinstance(report, GroupSnapshot):
            assert self._pack is not None
            self._pack = apply_snapshot(self._pack, report)
            check_pack(self._pack)
        elif isinstance(report, Finished | Failed):
            self.ends.append(report)
            if isinstance(report, Failed):
                assert report.line
                assert report.line.isprintable()
                assert len(report.line) <= 1000
            elif report.pack is not None:
                check_pack(report.pack)
                parse_metadata(metadata_json(report.pack))
                for outcome in report.outcomes:
                    assert "nan" not in outcome.line()


def left_of(process: StandIn) -> list[str]:
    """Names of shared memory that a stand-in was told of and that are still there."""
    told = [command for command in process.heard if isinstance(command, StartTraining)]
    names = [name for start in told for name in (start.input_block, start.snapshot_block)]
    return [name for name in names if Path("/dev/shm", name).exists()]


class Orders:
    """The worker's side of orders to train, with shared memory that they may name."""

    def __init__(self) -> None:
        self._block = SharedBlock.create(1 << 14)

    def named(self, start: StartTraining) -> StartTraining:
        """The order with the name of real memory where it has the one of `starts`."""
        return replace(
            start, input_block=self._name(start.input_block), snapshot_block=self._name(start.snapshot_block)
        )

    def _name(self, name: str) -> str:
        if name in (GIVEN_BLOCK, SNAPSHOT_BLOCK):
            return self._block.name
        # Other memory of this machine may be someone else's.
        return name if BLOCK_NAME.fullmatch(name) is None else "ntc-0-" + "f" * 16

    def close(self) -> None:
        """Give the memory back."""
        self._block.close()


REFUSED = (InputError, ValueError, OSError)
"""How the worker refuses an order."""
