"""Grouping in a process of its own: scikit-learn takes a second to import, and covisible needs OpenGL; a window must not wait.

The process lives as long as its one answer takes, and ends with the one that started it."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from ntc.codec.config import GroupingConfig
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from ntc.pack.model import Grouping
from ntc.worker.shared_arrays import SharedBlock, without_arrays
from viewer.locations import features_cache

NICENESS = 10
SECONDS_BETWEEN_QUESTIONS = 0.05
WITHOUT_FEATURES = ("baseline", "single", "category")
"""Found in no time, without another process."""


class StoppedError(Exception):
    """The preparation of a training is no longer wanted."""


@dataclass(frozen=True, eq=False)
class GroupingJob:
    """What is to be grouped."""

    config: GroupingConfig
    textures: tuple[SourceTexture, ...]
    """With their pixels."""
    scene: Path | None
    """For covisible: the file that is looked at."""


def grouping_inputs(job: GroupingJob) -> GroupingInputs:
    """What the grouping needs besides the textures. Raises InputError."""
    features = FeatureOptions(cache=features_cache())
    if job.config.name != "covisible":
        return GroupingInputs(features=features)
    if job.scene is None:
        raise InputError("covisible: the scene comes from no file that could be looked at; choose another grouping")
    from viewer.scene.load import load_scene
    from viewer.viewpoints.scene_views import ViewSource, scene_views

    scene = load_scene(job.scene)
    hashes = {texture.pixel_hash for texture in scene.textures}
    if not hashes >= {texture.pixel_hash for texture in job.textures}:
        # What is seen of one scene says nothing about the textures of another.
        raise InputError(f"{job.scene}: has changed since it was opened; open it again")
    seen = scene_views(scene, ViewSource(seed=job.config.seed))
    views = (*seen.exactly(seen.cameras), *seen.near(seen.cameras), *seen.from_sampled())
    seen.renderer.release()
    return GroupingInputs(views, {}, features)


def _end_with_parent(connection: Connection) -> None:
    """The other side never says anything: the pipe becomes readable when it is gone."""
    with suppress(EOFError, OSError):
        connection.recv_bytes()
    os._exit(0)


def _serve(connection: Connection, places: GroupingJob, block_name: str) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, args=(connection,), daemon=True).start()
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    job = places
    try:
        block = SharedBlock.open(block_name)
        job = block.read(places)
        block.close()
        answer: Grouping | str = make_grouping(job.config, job.textures, grouping_inputs(job))
    except InputError as error:
        answer = str(error)
    except Exception as error:
        answer = f"grouping {job.config.name}: {type(error).__name__}: {' '.join(str(error).split())}"
    with suppress(OSError):
        connection.send(answer)


def find_grouping(job: GroupingJob, stopped: Callable[[], bool]) -> Grouping:
    """What `make_grouping` finds. Raises InputError, and StoppedError as soon as `stopped` says so."""
    if job.config.name in WITHOUT_FEATURES:
        return make_grouping(job.config, job.textures)
    # Pixels go through shared memory: pickled, they would hold up the window's thread.
    block = SharedBlock.create(without_arrays(job)[2])
    try:
        return _answer(block.write(job), block.name, stopped)
    finally:
        block.close()


def _answer(job: GroupingJob, block_name: str, stopped: Callable[[], bool]) -> Grouping:
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there, job, block_name), name="ntc-grouping", daemon=True)
    try:
        process.start()
    except OSError as error:
        here.close()
        raise InputError(f"grouping: no process can be started ({error.strerror or error}); close others") from error
    finally:
        there.close()
    try:
        while not here.poll(SECONDS_BETWEEN_QUESTIONS):
            if stopped():
                raise StoppedError
        answer = here.recv()
    except (EOFError, OSError) as error:
        raise InputError("grouping: its process ended without an answer; start the training again") from error
    finally:
        here.close()
        process.kill()
        process.join()
        process.close()
    if isinstance(answer, str):
        raise InputError(answer)
    found: Grouping = answer
    return found
