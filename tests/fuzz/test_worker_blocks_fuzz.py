"""Background encoding in codec `block`: snapshots that no pack of blocks can hold end it, whole ones are taken."""

from dataclasses import replace
from typing import Any

import pytest

from ntc.training.snapshot import GroupSnapshot
from ntc.worker.protocol import Failed, Finished, Ready, Received, WorkerReport
from tests.support.worker_sessions import (
    BLOCK_CODEC,
    Session,
    left_of,
    placed,
    progress,
    small_request,
    snapshots,
    stream,
    whole_training,
)

IN_BLOCKS = small_request(BLOCK_CODEC)
IN_GRIDS: Any = placed(small_request(), snapshots(small_request()))[0]
"""A snapshot of codec `grid`."""
FIRST = stream([Ready()])


def _snapshot(**changes: Any) -> GroupSnapshot:
    return replace(placed(IN_BLOCKS, snapshots(IN_BLOCKS))[0], **changes)


def _with_texture(**changes: Any) -> GroupSnapshot:
    first, *others = _snapshot().textures
    return _snapshot(textures=(replace(first, **changes), *others))


WHOLE: Any = _snapshot()
"""With places instead of arrays."""


HOSTILE: dict[str, WorkerReport] = {
    "a decoder of codec grid": _snapshot(decoder=IN_GRIDS.decoder),
    "a texture of codec grid": _snapshot(textures=IN_GRIDS.textures),
    "codes of half a word": _with_texture(latents=replace(WHOLE.textures[0].latents, shape=(1, 2))),
    "a mean of too many channels": _with_texture(offset=replace(WHOLE.textures[0].offset, shape=(4,))),
    "codes that are no integers": _with_texture(latents=replace(WHOLE.textures[0].latents, dtype="<f4")),
    "a basis of other blocks": _snapshot(
        decoder=replace(WHOLE.decoder, basis=replace(WHOLE.decoder.basis, shape=(8, 16, 3)))
    ),
    "scales behind the block": _snapshot(
        decoder=replace(WHOLE.decoder, scales=replace(WHOLE.decoder.scales, offset=2**40))
    ),
    "an adapter": _with_texture(adapter=IN_GRIDS.textures[0].adapter),
}


def test_a_whole_encoding_in_blocks_is_taken() -> None:
    session = Session(FIRST, stream(whole_training(IN_BLOCKS)[1:]))
    session.start(IN_BLOCKS)
    session.run()
    assert isinstance(session.ends[0], Finished)
    assert session.ends[0].pack is not None
    assert session.ends[0].pack.config == BLOCK_CODEC
    session.worker.close()


@pytest.mark.parametrize("what", HOSTILE)
def test_snapshots_that_no_block_pack_can_hold_end_the_encoding(what: str) -> None:
    session = Session(FIRST, stream([Received(), progress(), HOSTILE[what]]))
    session.start(IN_BLOCKS)
    session.run()
    (end,) = session.ends
    assert isinstance(end, Failed)
    assert "invalid message" in end.line
    session.worker.close()
    assert all(left_of(process) == [] for process in session.processes)
