"""Encoding textures to a pack, in the caller's process."""

import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from ntc.codec.codec import Codec
from ntc.codec.encoding import CancelQuestion, EncodingChoices, EncodingOptions, file_header_bytes, texture_set
from ntc.codec.model import CodecSettings, Grouping, Pack
from ntc.codec.textures import SourceTexture
from ntc.errors import TrainingCancelledError, TrainingFailedError
from ntc.training.messages import ProgressListener, TrainingProgress, TrainingRequest, checked_request
from ntc.training.trainer import Trainer


class _CallingHost:
    """Host of a training in the caller's thread."""

    def __init__(self, listener: ProgressListener | None, cancelled: CancelQuestion | None) -> None:
        self._listener, self._cancelled = listener, cancelled

    def interruption(self) -> None:
        if self._cancelled is not None and self._cancelled():
            raise TrainingCancelledError

    def seconds(self) -> float:
        return time.monotonic()

    def progress(self, progress: TrainingProgress) -> None:
        if self._listener is not None:
            self._listener(progress)


def encode_textures(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    codec: CodecSettings,
    options: EncodingOptions,
    progress: ProgressListener | None = None,
    cancelled: CancelQuestion | None = None,
    state: Path | None = None,
    rescue: Path | None = None,
) -> Pack:
    """Encode `textures` in the groups of `grouping` to a pack. On one CPU the same seed gives the same pack.

    `state` is a file from which a stopped encoding continues; the pack is the same as without the stop. The file is written every
    minute, on cancellation and on failure, and removed at the end. Without `state`, the state of a failed training goes to `rescue`.

    Raises InputError for a device that is missing, for textures or groups that do not fit, and for a state of another training;
    TrainingFailedError if numbers overflow repeatedly; TrainingCancelledError if `cancelled` returns True.
    """
    request = TrainingRequest(tuple(textures), grouping, codec, options)
    return encode_request(request, progress, cancelled, state, rescue)


def encode_request(
    request: TrainingRequest,
    progress: ProgressListener | None = None,
    cancelled: CancelQuestion | None = None,
    state: Path | None = None,
    rescue: Path | None = None,
) -> Pack:
    """Return the pack of a request without a starting pack. Other parameters and errors are those of `encode_textures`."""
    trainer = Trainer(checked_request(request), _CallingHost(progress, cancelled), state)
    try:
        ended = trainer.run()
    except TrainingCancelledError:
        if state is not None:
            trainer.save(state)
        raise
    except TrainingFailedError as error:
        target = state or rescue
        if target is None:
            raise
        trainer.save(target)
        raise TrainingFailedError(f"{error}; the last good state is in {target}") from error
    if state is not None:
        with suppress(OSError):
            state.unlink(missing_ok=True)
    groups = [trainer.finished[group] for group in range(request.grouping.group_count)]
    encoded = dict(pair for each in groups for pair in zip(each.members, each.textures, strict=True))
    textures = tuple(encoded[index] for index in range(len(request.textures)))
    return Pack(trainer.settings, request.grouping, textures, tuple(each.decoder for each in groups), ended.record)


def chosen_request(
    textures: Sequence[SourceTexture], grouping: Grouping, codec: Codec, choices: EncodingChoices
) -> TrainingRequest:
    """Return the request to encode `textures` with the settings and options that the codec derives from `choices`.

    Raises InputError for a target that cannot be reached.
    """
    header = file_header_bytes(textures, grouping)
    settings = codec.settings_for(texture_set(textures, grouping.stored_decoders, choices.levels, header), choices)
    return TrainingRequest(tuple(textures), grouping, settings, codec.options_for(choices))


def encode_chosen(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    codec: Codec,
    choices: EncodingChoices,
    progress: ProgressListener | None = None,
    cancelled: CancelQuestion | None = None,
    rescue: Path | None = None,
) -> Pack:
    """Encode `textures` to a pack, with the settings and options that the codec derives from `choices`.

    Other parameters and errors are those of `encode_textures`. Raises InputError also for a target that cannot be reached.
    """
    request = chosen_request(textures, grouping, codec, choices)
    return encode_request(request, progress, cancelled, choices.state, rescue)
