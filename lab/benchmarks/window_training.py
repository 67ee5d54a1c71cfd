"""Responsiveness of a window while it trains: frame times with and without training, seconds to the first neural picture.

The window's content without a window, path `cached`, still camera, overlay on, a panel dragged about, at most 60 frames a second.
Phases: encode the scene from nothing; rest; retrain all groups; rest. Nothing else should run on the machine.

    python -m lab.benchmarks.window_training SCENE --json lab/benchmarks/results/window_training_llvmpipe.json
"""

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

from lab.benchmarks.measuring import arguments, chosen_cameras, report
from ntc.io import write_text
from tests.support.driven_app import DrivenApp
from viewer.commands import run_line
from viewer.scene.load import load_scene
from viewer.state.open_files import InitialView
from viewer.state.settings import ViewerSettings
from viewer.state.view_state import Overlay

FRAME_SECONDS = 1.0 / 60.0


class Window:
    """An app whose frames are timed while a panel is dragged."""

    def __init__(self, app: DrivenApp) -> None:
        self.app = app
        app.settle()
        self._at = app.widgets.centre("Timings")
        app.move(*self._at)
        app.button(True)
        self._frames = 0

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


def main() -> None:
    parser = arguments(__doc__)
    parser.set_defaults(size=(960, 540))
    parser.add_argument("--texture-size", type=int, default=256)
    parser.add_argument("--clusters", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=30.0, help="of each training")
    parser.add_argument("--codec", choices=("block", "grid"), default="block")
    options = parser.parse_args()
    scene = load_scene(options.scene)
    camera = chosen_cameras(scene, options.cameras, options.camera)[0]
    loads = [os.getloadavg()[0]]
    with tempfile.TemporaryDirectory() as folder:
        settings = ViewerSettings(window_size=options.size)
        app = DrivenApp(scene, {}, options.size, Path(folder), settings, InitialView("reference", "cached"))
        session = app.session
        session.view = replace(session.view, camera=camera, overlay=Overlay("divergence"))
        window = Window(app)
        training = app.training
        rows = [summary("before, reference", window.frames_while(lambda: True, 5.0))]
        encode = f"training.encode clustered {options.clusters} {options.texture_size} {options.seconds:g}s best {options.codec}"
        run_line(app.context, encode)
        window_rows = window.frames_while(lambda: training.state == "preparing", 120.0)
        rows.append(summary("preparing", window_rows))
        run = training.active
        waiting = window.frames_while(lambda: run is not None and not run.groups_seen, 120.0)
        # The frame of the first snapshot compiles shaders: it is shown apart.
        rows.append(summary("until the first picture", waiting[:-1]))
        rows.append(summary("the first picture itself", waiting[-1:]))
        first = run.first_picture_seconds if run is not None else None
        rows.append(summary("encoding", window.frames_while(lambda: training.active is not None, 600.0)))
        curves = training.curves
        mean_db = [curves.mean_db[0], curves.mean_db[-1]] if curves is not None and curves.mean_db else []
        session.view = replace(session.view, compare="a")
        window.frames_while(lambda: True, 5.0)
        loads.append(os.getloadavg()[0])
        rows.append(summary("without training", window.frames_while(lambda: True, 15.0)))
        run_line(app.context, f"training.retrain all {options.seconds:g}s")
        rows.append(summary("preparing again", window.frames_while(lambda: training.state == "preparing", 120.0)))
        rows.append(summary("retraining", window.frames_while(lambda: training.active is not None, 600.0)))
        rows.append(summary("without, again", window.frames_while(lambda: True, 15.0)))
        loads.append(os.getloadavg()[0])
        facts = {
            "scene": scene.name,
            "size": list(options.size),
            "renderer": app.frontend.facts().renderer,
            "cores": os.cpu_count(),
            "first_picture_seconds": first,
            "psnr_db_first_and_last": mean_db,
            "runs": [(run.title, run.outcome, run.psnr_db) for run in training.log.runs],
            "load_average": loads,
            "toasts": [toast.text for toast in session.window.toasts],
        }
        app.close()
    report("frame times while training", rows, facts, None)
    if options.json is not None:
        write_text(options.json, json.dumps({**facts, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
