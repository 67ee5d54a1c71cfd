"""Measures one scene in this process: python -m lab.benchmarks.geometry.measure SCENE OUT.json [--frames N]."""

import argparse
import json
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from lab.bench.scene import nudged
from lab.benchmarks.measuring import median, size_of
from ntc.io import write_text
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.render import scene_drawer
from viewer.render.passes import cull_clusters
from viewer.render.renderer import Renderer
from viewer.scene.load import load_scene
from viewer.scene.model import Camera, Scene
from viewer.state.view_state import ViewState

MIB = 1 << 20
MEANS = ("gpu", "cpu", "none")
"""By what is culled; the first is what a viewer on a GPU does."""


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


@contextmanager
def culled_by(means: str) -> Iterator[None]:
    """Renderers made within the block cull on the `gpu` (where that pays), on the `cpu`, or draw everything (`none`)."""
    with ExitStack() as patches:
        patches.enter_context(patch.object(scene_drawer, "ON_SOFTWARE", True))
        if means == "cpu":
            patches.enter_context(patch.object(scene_drawer, "LEAST_CLUSTERS", 1 << 60))
        if means == "none":
            patches.enter_context(patch.object(cull_clusters, "ALL_TESTS", 0))
            patches.enter_context(patch.object(scene_drawer, "LEAST_CLUSTERS", 0))
        yield


def frame_rows(
    context: GraphicsContext, renderer: Renderer, scene: Scene, size: tuple[int, int], frames: int
) -> list[dict[str, Any]]:
    """Median times in ms of `frames` frames of each camera, which moves a little, and what was left out."""
    rows = []
    for camera in cameras(scene):
        found: dict[str, list[float]] = {}
        for number in range(-1, frames):
            began = time.perf_counter()
            frame = renderer.render(ViewState(nudged(camera, number), size, material_view="base"))
            context.gl.finish()
            if number >= 0:
                found.setdefault("frame", []).append(1000.0 * (time.perf_counter() - began))
                for name in ("cull", "visibility"):
                    found.setdefault(name, []).append(frame.timings_ms[name])
        row: dict[str, Any] = {"camera": camera.name}
        row |= {f"{name}_ms": round(median(values), 1) for name, values in found.items()}
        row |= {name: frame.skipped[name] for name in ("clusters_culled", "triangles_culled")}
        rows.append(row | dict(frame.drawn))
    return rows


def measured(path: Path, size: tuple[int, int], frames: int) -> dict[str, Any]:
    """Seconds to open and to the first picture, peak memory of both, and frames by every means of culling."""
    peak, before, start = PeakMemory(), resident_bytes(), time.perf_counter()
    scene = load_scene(path)
    opened = time.perf_counter()
    geometry = scene.geometry
    arrays = (geometry.positions, geometry.uvs, geometry.indices, geometry.normals)
    record: dict[str, Any] = {
        "scene": path.stem,
        "file_mib": path.stat().st_size / MIB,
        "triangles": scene.report.used["triangles"],
        "triangles_drawn": scene.report.used["triangles drawn"],
        "instances": len(scene.instances.primitive),
        "open_seconds": opened - start,
        "before_mib": before / MIB,
        "open_peak_mib": peak.take() / MIB,
        "opened_mib": resident_bytes() / MIB,
        "arrays_bytes_a_triangle": sum(array.nbytes for array in arrays if array is not None)
        / scene.report.used["triangles"],
        "gpu_bytes_a_triangle": (geometry.positions.nbytes + geometry.uvs.nbytes + geometry.indices.nbytes)
        / scene.report.used["triangles"],
    }
    context = create_headless_context()
    rows: list[dict[str, Any]] = []
    for means in MEANS:
        with culled_by(means):
            renderer = Renderer(context, scene)
        renderer.render(ViewState(cameras(scene)[0], size, material_view="base"))
        context.gl.finish()
        if means == MEANS[0]:
            record["first_picture_seconds"] = time.perf_counter() - start
            record["first_picture_peak_mib"] = peak.take() / MIB
        rows += [{"culled_by": means} | row for row in frame_rows(context, renderer, scene, size, frames)]
        if means == MEANS[0]:
            record["drawing_peak_mib"] = peak.take() / MIB
        renderer.release()
    peak.end()
    return {**record, "renderer": context.info.renderer, "size": list(size), "frames": frames, "rows": rows}


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
