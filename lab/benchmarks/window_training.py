"""Responsiveness of a window while it trains: frame times with and without training, seconds to the first neural picture.

The window's content without a window, path `cached`, still camera, overlay on, a panel dragged about, at most 60 frames a second.
First pictures: the encoding is accepted as soon as the scene is drawn, and after some seconds of looking, each in a window of its
own without cached features; at rest, drawing where there is cause to, and with the panel dragged. Phases: encode the scene from
nothing; rest; retrain all groups; rest. Nothing else should run on the machine.

    python -m lab.benchmarks.window_training SCENE --json lab/benchmarks/results/window_training_llvmpipe.json
"""

import argparse
import json
import math
import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lab.runner import chosen_cameras, report, run, scene_options, write_record
from ntc.codec.registry import codec_named
from tests.support.driven_app import DrivenApp
from viewer.commands import run_line
from viewer.locations import CACHE_FOLDER_VARIABLE
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.open_files import InitialView
from viewer.state.settings import ViewerSettings
from viewer.state.view_state import Overlay

FRAME_SECONDS = 1.0 / 60.0


class PersonsApp(DrivenApp):
    """It prepares the encoding that it offers, as a window does."""

    prepares_ahead = True


class Window:
    """An app whose frames are timed while a panel is dragged."""

    def __init__(self, app: DrivenApp) -> None:
        self.app = app
        app.settle()
        self._at = app.widgets.centre("Timings")
        app.move(*self._at)
        app.button(True)
        self._frames = 0

    def frames_at_rest_while(self, wanted: Callable[[], bool], longest: float) -> list[dict[str, Any]]:
        """As a window that nobody touches: a frame where there is cause to draw one."""
        began, rows = time.monotonic(), []
        while wanted() and time.monotonic() - began < longest:
            if self.app.frontend.needs_frame(self.app.size):
                start = time.perf_counter()
                self.app.frame()
                self.app.graphics.gl.finish()
                rows.append({"ms": 1e3 * (time.perf_counter() - start)})
            time.sleep(FRAME_SECONDS / 4.0)
        return rows

    def frames_while(self, wanted: Callable[[], bool], longest: float) -> list[dict[str, Any]]:
        """One row for each frame: its time in ms, and what the training did meanwhile."""
        training = self.app.training
        began = time.monotonic()
        rows = []
        while wanted() and time.monotonic() - began < longest:
            self._frames += 1
            angle = self._frames * 0.1
            state, packs = training.state, self.app.session.packs
            start = time.perf_counter()
            self.app.move(self._at[0] + 20.0 * math.cos(angle), self._at[1] + 10.0 * math.sin(angle))
            self.app.graphics.gl.finish()
            spent = time.perf_counter() - start
            rows.append({"ms": 1e3 * spent, "state": state, "snapshot": packs is not self.app.session.packs})
            time.sleep(max(0.0, FRAME_SECONDS - spent))
        return rows


def summary(name: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Percentiles of frame times in ms."""
    times = np.array([row["ms"] for row in rows]) if rows else np.zeros(1)
    snapshots = [row["ms"] for row in rows if row["snapshot"]]
    found = {
        "phase": name,
        "frames": len(rows),
        "p50 ms": float(np.percentile(times, 50)),
        "p99 ms": float(np.percentile(times, 99)),
        "longest ms": float(times.max()),
        "over 50 ms": int((times > 50.0).sum()),
        "over 100 ms": int((times > 100.0).sum()),
        "snapshots": len(snapshots),
        "longest with one": max(snapshots, default=0.0),
    }
    # Whoever stops it early still has the phases so far.
    print(json.dumps(found), file=sys.stderr, flush=True)
    return found


def opened(scene: Scene, options: argparse.Namespace, folder: Path) -> PersonsApp:
    """A window on the scene, without packs."""
    settings = ViewerSettings(window_size=options.size, column_folded=False)
    app = PersonsApp(scene, {}, options.size, folder, settings, InitialView("reference", "cached"))
    camera = chosen_cameras(scene, options.cameras, options.camera)[0]
    app.session.view = replace(app.session.view, camera=camera, overlay=Overlay("divergence"))
    return app


def first_picture(scene: Scene, options: argparse.Namespace, looking: float, dragging: bool) -> dict[str, Any]:
    """Seconds from accepting to what leads to the first neural picture, accepted after `looking` seconds."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ[CACHE_FOLDER_VARIABLE] = folder
        return _first_picture(opened(scene, options, Path(folder)), options, looking, dragging)


def _first_picture(app: PersonsApp, options: argparse.Namespace, looking: float, dragging: bool) -> dict[str, Any]:
    window, training, began = Window(app), app.training, time.monotonic()
    frames = window.frames_while if dragging else window.frames_at_rest_while
    frames(lambda: True, looking)
    looked = time.monotonic() - began
    run_line(
        app.context, f"training.encode clustered {options.clusters} {options.texture_size} 1s best {options.codec}"
    )
    run, accepted = training.active, time.monotonic()
    assert run is not None
    found: dict[str, Any] = {"window": "dragged" if dragging else "at rest", "looked for": looked}

    def seconds_until(name: str, waits: Callable[[], bool]) -> list[dict[str, Any]]:
        rows = frames(waits, 120.0)
        found[name] = time.monotonic() - accepted
        return rows

    seconds_until("prepared", lambda: training.state == "preparing")
    rows = seconds_until("first picture", lambda: run.published is None)
    found["of it drawing"] = rows[-1]["ms"] / 1e3 if rows else 0.0
    seconds_until("its tiles", lambda: bool(app.frontend.picture.to_come))
    seconds_until("whole pack", lambda: training.active is not None)
    app.close()
    print(json.dumps(found), file=sys.stderr, flush=True)
    return found


def phases(app: PersonsApp, options: argparse.Namespace) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Frame times by phase, and what else became of the runs."""
    session, training, window = app.session, app.training, Window(app)
    rows = [summary("before, reference", window.frames_while(lambda: True, 5.0))]
    how = f"{options.clusters} {options.texture_size} {options.seconds:g}s best {options.codec}"
    run_line(app.context, f"training.encode clustered {how}")
    rows.append(summary("preparing", window.frames_while(lambda: training.state == "preparing", 120.0)))
    run = training.active
    waiting = window.frames_while(lambda: run is not None and not run.groups_seen, 120.0)
    # The frame of the first snapshot compiles shaders: it is shown apart.
    rows.append(summary("until the first picture", waiting[:-1]))
    rows.append(summary("the first picture itself", waiting[-1:]))
    rows.append(summary("encoding", window.frames_while(lambda: training.active is not None, 600.0)))
    curves = training.curves
    mean_db = [curves.mean_db[0], curves.mean_db[-1]] if curves is not None and curves.mean_db else []
    session.view = replace(session.view, compare="a")
    window.frames_while(lambda: True, 5.0)
    rows.append(summary("without training", window.frames_while(lambda: True, 15.0)))
    again = f"retrain all {options.seconds:g}s" if codec_named(options.codec).trains else "regroup baseline"
    run_line(app.context, f"training.{again}")
    rows.append(summary("preparing again", window.frames_while(lambda: training.state == "preparing", 120.0)))
    rows.append(summary("retraining", window.frames_while(lambda: training.active is not None, 600.0)))
    rows.append(summary("without, again", window.frames_while(lambda: True, 15.0)))
    facts = {
        "psnr_db_first_and_last": mean_db,
        "runs": [(run.title, run.settings, run.outcome, run.psnr_db) for run in training.log.runs],
        "toasts": [toast.text for toast in session.window.toasts],
    }
    return rows, facts


def main() -> None:
    parser = scene_options(__doc__)
    parser.set_defaults(size=(960, 540))
    parser.add_argument("--texture-size", type=int, default=256)
    parser.add_argument("--clusters", default="auto")
    parser.add_argument("--seconds", type=float, default=30.0, help="of each training")
    parser.add_argument("--codec", choices=("block", "grid"), default="block")
    parser.add_argument("--looking", type=float, nargs="*", default=[0.0, 10.0], help="seconds before accepting")
    parser.add_argument("--first-pictures-only", action="store_true", help="measure nothing else")
    options = parser.parse_args()
    scene = load_scene(options.scene)
    loads = [os.getloadavg()[0]]
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        ways = [(seconds, dragging) for dragging in (False, True) for seconds in options.looking]
        firsts = [first_picture(scene, options, *way) for way in ways]
        app = opened(scene, options, Path(folder))
        facts: dict[str, Any] = {
            "scene": scene.name,
            "size": list(options.size),
            "renderer": app.frontend.facts().renderer,
            "cores": len(os.sched_getaffinity(0)),
            "codec": options.codec,
            "first_pictures": firsts,
        }
        if not options.first_pictures_only:
            rows, more = phases(app, options)
            facts |= more
        app.close()
    facts["load_average"] = [*loads, os.getloadavg()[0]]
    report("seconds from accepting", firsts, {}, None)
    report("frame times while training", rows, facts, None)
    write_record(options.json, {**facts, "rows": rows})


if __name__ == "__main__":
    run(main)
