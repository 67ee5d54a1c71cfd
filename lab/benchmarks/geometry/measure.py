"""Measures one scene in this process: python -m lab.benchmarks.geometry.measure SCENE OUT.json [--frames N] [--without-culling]."""

import argparse
import json
import os
import resource
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from lab.bench.scene import nudged
from lab.benchmarks.measuring import median, size_of
from ntc.io import write_text
from viewer.gl.context import create_headless_context
from viewer.render.renderer import Renderer
from viewer.scene.load import load_scene
from viewer.scene.model import Camera, Scene
from viewer.state.view_state import ViewState

MIB = 1 << 20


def resident_bytes() -> int:
    """Of this process, now (Linux)."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


class PeakMemory:
    """The most memory that this process has had since the start or the last question, looked at every few ms (Linux)."""

    def __init__(self) -> None:
        self._peak = 0
        self._ended = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        while not self._ended.wait(0.01):
            self._peak = max(self._peak, resident_bytes())

    def take(self) -> int:
        """Bytes; the next answer begins anew."""
        found = max(self._peak, resident_bytes())
        self._peak = 0
        return found

    def end(self) -> None:
        """Stop looking."""
        self._ended.set()


def cameras(scene: Scene) -> tuple[Camera, ...]:
    """Above the whole scene; among the bodies at its middle; before one of them."""
    low, high = scene.bounds.astype(np.float64)
    middle, span = (low + high) / 2.0, float(np.linalg.norm(high - low))
    spots = {
        "overview": (middle + np.array([0.0, 0.45, 0.62]) * span, middle),
        "street": (
            middle + np.array([0.0, 0.5, 0.0]),
            middle + np.array([0.31, 0.45, 1.0]) * np.array([span, 1.0, span]),
        ),
        "close": (middle + np.array([0.2, 0.2, 2.0]), middle),
    }
    return tuple(Camera(name, tuple(eye.tolist()), tuple(target.tolist())) for name, (eye, target) in spots.items())


def measured(path: Path, size: tuple[int, int], frames: int) -> dict[str, Any]:
    """Seconds to open and to the first picture, peak memory of both, and for each camera the frame's times."""
    peak, before, start = PeakMemory(), resident_bytes(), time.perf_counter()
    scene = load_scene(path)
    opened = time.perf_counter()
    record: dict[str, Any] = {
        "file_mib": path.stat().st_size / MIB,
        "triangles": scene.report.used["triangles"],
        "triangles_drawn": scene.report.used["triangles drawn"],
        "instances": len(scene.instances.primitive),
        "before_mib": before / MIB,
        "open_seconds": opened - start,
        "open_peak_mib": peak.take() / MIB,
        "opened_mib": resident_bytes() / MIB,
    }
    views = cameras(scene)
    context = create_headless_context()
    renderer = Renderer(context, scene)
    renderer.render(ViewState(views[0], size, material_view="base"))
    renderer.picture_bytes() if hasattr(renderer, "picture_bytes") else context.gl.finish()
    record["first_picture_seconds"] = time.perf_counter() - start
    record["first_picture_peak_mib"] = peak.take() / MIB
    record["renderer"] = context.info.renderer
    rows = []
    for camera in views:
        found: dict[str, list[float]] = {}
        for number in range(-1, frames):
            began = time.perf_counter()
            frame = renderer.render(ViewState(nudged(camera, number), size, material_view="base"))
            context.gl.finish()
            if number >= 0:
                found.setdefault("frame", []).append(1000.0 * (time.perf_counter() - began))
                for name, milliseconds in frame.timings_ms.items():
                    found.setdefault(name, []).append(milliseconds)
        row = {"camera": camera.name} | {f"{name}_ms": median(values) for name, values in found.items()}
        culled = {name: frame.skipped[name] for name in ("clusters_culled", "triangles_culled")}
        rows.append(row | culled | dict(frame.drawn))
    record["cameras"] = rows
    record["drawing_peak_mib"] = peak.take() / MIB
    record["peak_mib"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / MIB
    peak.end()
    return record


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--size", type=size_of, default=(1280, 720), metavar="WxH")
    parser.add_argument("--frames", type=int, default=3)
    given = parser.parse_args()
    write_text(given.out, json.dumps(measured(given.scene, given.size, given.frames), indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
