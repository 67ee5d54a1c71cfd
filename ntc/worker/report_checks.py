"""Checks of what the training process reports against the training that was requested. Needs no torch.

The process is this program's own, but a damaged report must not end the window.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Any

from ntc.errors import InputError
from ntc.training.progress import Ended, TrainingProgress
from ntc.training.request import TrainingRequest
from ntc.training.snapshot import GroupSnapshot
from ntc.worker.protocol import Failed

LARGEST_SECONDS = 1e12
"""Seconds: larger times are refused."""
LARGEST_LOSS = 1e40
"""Larger losses are refused; single precision ends below."""
DEEPEST_RECORD = 32
LONGEST_LINE = 1000


def check_progress(progress: TrainingProgress, request: TrainingRequest) -> None:
    """Raises ValueError for numbers out of range, and for groups and textures that are not trained."""
    if not 0 <= progress.step <= progress.steps:
        raise ValueError(f"step {progress.step} of {progress.steps}")
    numbers = (progress.seconds_left, progress.elapsed_seconds, progress.ktexels_per_second, progress.freezing_scale)
    if not all(0.0 <= number <= LARGEST_SECONDS for number in numbers):
        raise ValueError(f"progress: {numbers}")
    if not progress.note.isprintable() or len(progress.note) > LONGEST_LINE:
        raise ValueError("the note is not one line")
    _check_keys(progress.losses, request.dirty or (), "group")
    _check_keys(progress.psnr_db, range(len(request.textures)), "texture")
    if not all(0.0 <= loss <= LARGEST_LOSS for loss in progress.losses.values()):
        raise ValueError("a loss is out of range")
    for _decibels in progress.psnr_db.values():
        pass


def _check_keys(found: Iterable[int], known: Iterable[int], what: str) -> None:
    unknown = set(found) - set(known)
    if unknown:
        raise ValueError(f"{what} {min(unknown)} is not trained")


def check_snapshot(snapshot: GroupSnapshot, request: TrainingRequest) -> None:
    """Raises ValueError for a group that is not trained, other textures than its own, and what the codec cannot decode."""
    group = snapshot.group
    _check_keys((group,), request.dirty or (), "group")
    if snapshot.members != request.grouping.members(group):
        raise ValueError(f"group {group} has other textures")
    if len(snapshot.textures) != len(snapshot.members):
        raise ValueError(f"group {group} has {len(snapshot.members)} textures, and {len(snapshot.textures)} came")
    for index, found in zip(snapshot.members, snapshot.textures, strict=True):
        source = request.textures[index]
        expected = (
            source.pixel_hash,
            *source.size,
            source.maps,
            source.channels,
            source.color_space,
            source.wrap,
            group,
        )
        size = (found.width, found.height)
        own = (found.pixel_hash, *size, found.maps, found.channels, found.color_space, found.wrap, found.group)
        # A group that stays as it was keeps the names that the pack has.
        names = [(source.name, source.category)]
        if request.start is not None:
            names.append((request.start.textures[index].name, request.start.textures[index].category))
        if own != expected or (found.name, found.category) not in names:
            raise ValueError(f"texture {index} is another one")


def check_ended(ended: Ended, request: TrainingRequest) -> None:
    """Raises ValueError for outcomes of groups that are not trained, and a record that is not JSON."""
    groups = [outcome.group for outcome in ended.outcomes]
    _check_keys(groups, request.dirty or (), "group")
    if len(groups) != len(set(groups)):
        raise ValueError("a group ended twice")
    for outcome in ended.outcomes:
        pass
        if outcome.before_db is not None:
            pass
    _check_json(ended.record, DEEPEST_RECORD)


def _check_json(value: Any, depth: int) -> None:
    if depth < 0:
        raise ValueError("the record is nested too deep")
    if isinstance(value, Mapping):
        if not all(isinstance(key, str) for key in value):
            raise ValueError("the record has a key that is not text")
        value = list(value.values())
    if isinstance(value, list | tuple):
        for part in value:
            _check_json(part, depth - 1)
    elif not (value is None or isinstance(value, str | int | float)) or (
        isinstance(value, float) and not math.isfinite(value)
    ):
        raise ValueError(f"the record holds a {type(value).__name__} that is not JSON")


def sanitize(failed: Failed) -> Failed:
    """`failed` with its line cut to 1000 printable characters on one line."""
    return Failed(str(InputError(failed.line))[:LONGEST_LINE] or "training: failed", failed.details)
