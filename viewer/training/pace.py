"""How fast this machine encodes: measured on parts of textures, and learned from encodings that have ended."""

import json
from contextlib import suppress

import msgspec

from ntc.codec.codec import Codec
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.io import read_file, write_text
from ntc.training.messages import TrainingRequest
from viewer.locations import pace_file

LARGEST_PACE_FILE = 10_000
LEAST_SECONDS = 1.0
"""Shorter encodings tell little about speed."""
MOST_CORRECTION = 3.0
"""Most by which whole encodings are taken to be slower or faster than parts of textures."""


class Speed(msgspec.Struct, frozen=True):
    """Speed of one codec on this machine."""

    part: float | None = None
    """Seconds for a unit of work (`Codec.encoding_work`) in the encoding of a part of a texture that was measured last."""
    run: float | None = None
    """Seconds for a unit of work in the whole encoding that ended last."""
    correction: float = 1.0
    """Seconds of whole encodings over those that parts of their textures promised."""

    @property
    def seconds_per_work(self) -> float | None:
        """Seconds for a unit of work in a whole encoding; None before anything was measured."""
        return self.run if self.part is None else self.part * self.correction


class Pace:
    """Speed of this machine, remembered in the user's data folder."""

    def __init__(self) -> None:
        self._known: dict[str, Speed] | None = None

    def _read(self) -> dict[str, Speed]:
        if self._known is None:
            self._known = {}
            with suppress(OSError, InputError, msgspec.MsgspecError):
                found = msgspec.json.decode(read_file(pace_file(), LARGEST_PACE_FILE), type=dict[str, Speed])
                self._known = {name: speed for name, speed in found.items() if _is_sound(speed)}
        return self._known

    def seconds_per_work(self, codec: Codec) -> float | None:
        """Return the seconds for a unit of work of a codec; None before it was measured, and for codecs that train."""
        known = self._read().get(codec.settings_type.kind)
        return None if known is None or codec.trains else known.seconds_per_work

    def expected_seconds(self, request: TrainingRequest) -> float | None:
        """Return the seconds that an encoding from nothing is expected to take; None where that is not known."""
        codec, pace = codec_of(request.codec), self.seconds_per_work(codec_of(request.codec))
        return None if pace is None or request.start is not None else pace * _work(codec, request)

    def note_part(self, codec: str, seconds_per_work: float) -> None:
        """Remember the speed at which a part of a texture was encoded."""
        known = self._read().get(codec, Speed())
        self._note(codec, msgspec.structs.replace(known, part=seconds_per_work))

    def note_run(self, request: TrainingRequest, seconds: float) -> None:
        """Learn from an encoding that has ended. No effect for one that says nothing about speed."""
        codec = codec_of(request.codec)
        if codec.trains or request.start is not None or seconds < LEAST_SECONDS:
            return
        run, known = seconds / _work(codec, request), self._read().get(request.codec.kind, Speed())
        correction = 1.0 if known.part is None else run / known.part
        correction = min(max(correction, 1.0 / MOST_CORRECTION), MOST_CORRECTION)
        self._note(request.codec.kind, msgspec.structs.replace(known, run=run, correction=correction))

    def _note(self, codec: str, speed: Speed) -> None:
        self._read()[codec] = speed
        with suppress(OSError, InputError):
            pace_file().parent.mkdir(parents=True, exist_ok=True)
            write_text(pace_file(), json.dumps(msgspec.to_builtins(self._read())) + "\n")


def _is_sound(speed: Speed) -> bool:
    seconds = [value for value in (speed.part, speed.run) if value is not None]
    return all(0.0 < value < 1e3 for value in seconds) and 1.0 / MOST_CORRECTION <= speed.correction <= MOST_CORRECTION


def _work(codec: Codec, request: TrainingRequest) -> float:
    grouping = request.grouping
    groups = [[request.textures[index].size for index in grouping.members(n)] for n in range(grouping.group_count)]
    return codec.encoding_work(groups, request.codec, request.training, not grouping.stored_decoders)
