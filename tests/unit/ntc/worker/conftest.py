"""A process that trains and a pack that was trained without one, for all tests of this folder."""

import os
from collections.abc import Iterator
from dataclasses import replace

import pytest

from ntc.codec.model import Pack
from ntc.training.encode import encode_textures
from ntc.worker.client import Finished, TrainingWorker
from ntc.worker.process import Failed
from tests.support.training_workers import (
    BLOCK_CODEC,
    BLOCKS_FROM_NOTHING,
    CODEC,
    ENDLESS,
    FROM_NOTHING,
    GROUPS,
    MANY_BLOCKS,
    SHORT,
    TEXTURES,
    CodecCase,
    encoded_by_group,
    threads,
    until,
)


@pytest.fixture(scope="session")
def process() -> Iterator[TrainingWorker]:
    """One process for all tests that do not kill it: importing torch takes seconds."""
    with TrainingWorker() as worker:
        yield worker


@pytest.fixture
def shared(process: TrainingWorker) -> Iterator[TrainingWorker]:
    """`process`, free again afterwards, also where a test has failed."""
    yield process
    if process.busy:
        process.cancel()
        until(process, (Finished, Failed))


@pytest.fixture(scope="session")
def trained() -> Pack:
    """What training without a process gives, with as many threads as the process has."""
    with threads(max(1, len(os.sched_getaffinity(0)) - 1)):
        return encode_textures(TEXTURES, GROUPS, CODEC, SHORT)


@pytest.fixture(scope="session", params=["grid", "block"])
def case(request: pytest.FixtureRequest, trained: Pack) -> CodecCase:
    """The codecs, one after the other."""
    if request.param == "grid":
        return CodecCase(FROM_NOTHING, replace(FROM_NOTHING, training=ENDLESS), trained)
    encoded = encoded_by_group(TEXTURES, GROUPS, BLOCK_CODEC, SHORT.seed)
    return CodecCase(BLOCKS_FROM_NOTHING, MANY_BLOCKS, encoded)
