"""Processor time that the driver takes to compile the programs of the first picture.

    MESA_SHADER_CACHE_DISABLE=true python -m lab.benchmarks.first_picture SCENE --pack F.ntc [--json FILE]

Slot A shows the pack, slot B the originals, lit, beside each other. llvmpipe compiles a program when it is made, and again when it is
first run. So a pass counts the time in which its programs are made, and its first run less the second one. The picture is small: a run
takes little else. Uploads and the filtering of environments, which both happen once, are left out.
"""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any, Final, get_args
from unittest.mock import patch

from lab.runner import chosen_cameras, report, run, scene_options
from ntc.pack.file import read_pack
from viewer.gl.context import create_headless_context
from viewer.gl.program import ProgramFactory
from viewer.gl.timer import PassTimer
from viewer.render.frames import FrameResult
from viewer.render.renderer import Renderer
from viewer.scene.load import load_scene
from viewer.state.view_state import DecodePath, Slot, ViewState

SIZE: Final = (64, 64)
"""Pixels of the picture."""
ONCE: Final = ("upload", "prefilter")
"""What the first frame does besides compiling."""
DECODING: Final = "decode_"
"""How the names of passes that decode begin."""


class _Watch:
    """Notes the processor time of making programs outside of passes."""

    def __init__(self) -> None:
        self.made: defaultdict[str, float] = defaultdict(float)
        """ms by the folder of the last stage's file, which has the name of its pass."""
        self._passes = 0

    @contextmanager
    def _in_pass(self, measure: Any, timer: PassTimer, name: str) -> Iterator[None]:
        self._passes += 1
        with measure(timer, name):
            yield
        self._passes -= 1

    def _making(self, make: Any) -> Any:
        def made(*arguments: Any) -> Any:
            start = time.process_time()
            program = make(*arguments)
            if not self._passes:
                file = next(own for own in reversed(arguments) if isinstance(own, str))
                self.made[PurePosixPath(file).parent.name] += 1e3 * (time.process_time() - start)
            return program

        return made

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Watch what renderers do; times of passes are processor times meanwhile."""
        making = {name: self._making(getattr(ProgramFactory, name)) for name in ("compute", "program")}
        measure = PassTimer.measure
        with (
            patch.multiple(ProgramFactory, **making),
            patch.object(PassTimer, "measure", lambda timer, name: self._in_pass(measure, timer, name)),
            patch.object(time, "perf_counter", time.process_time),
        ):
            yield


def draw(renderer: Renderer, view: ViewState, size: tuple[int, int]) -> FrameResult:
    """Draw `view` with `size` pixels."""
    return renderer.render(replace(view, size=size))


def compile_ms(draw: Callable[[tuple[int, int]], FrameResult]) -> dict[str, float]:
    """Processor time of compiling in ms by pass. `draw` takes (width, height): of another size all is drawn again.

    Both sides are powers of two: for other sizes llvmpipe compiles again.
    """
    watch = _Watch()
    with watch.watching():
        first = draw(SIZE).timings_ms
        made = dict(watch.made)
        again = draw((SIZE[0], 2 * SIZE[1])).timings_ms
    spent: dict[str, float] = {name: first[name] - again.get(name, 0.0) for name in first if name not in ONCE}
    for name, milliseconds in made.items():
        spent[name] = spent.get(name, 0.0) + milliseconds
    return {name: milliseconds for name, milliseconds in spent.items() if milliseconds >= 1.0}


def main() -> None:
    """Print and write the table."""
    parser = scene_options(__doc__)
    parser.add_argument("--pack", type=Path, required=True)
    parser.add_argument("--path", action="append", choices=get_args(DecodePath), help="may be given again")
    options = parser.parse_args()
    scene, pack = load_scene(options.scene), read_pack(options.pack)
    camera = chosen_cameras(scene, options.cameras, options.camera)[0]
    found: list[dict[str, Any]] = []
    for path in options.path or ("deferred", "cached"):
        context = create_headless_context()
        renderer = Renderer(context, scene)
        renderer.set_packs({"p": pack})
        view = ViewState(camera, SIZE, Slot("p", path), Slot(), compare="wipe", material_view="lit")
        spent = compile_ms(partial(draw, renderer, view))
        decode = sum(milliseconds for name, milliseconds in spent.items() if name.startswith(DECODING))
        found.append({"path": path, "decode ms": decode, "all ms": sum(spent.values()), **spent})
        renderer.release()
    names = dict.fromkeys(name for row in found for name in row if not name.startswith(DECODING))
    rows = [{name: row.get(name, 0.0) for name in names} for row in found]
    facts = {"scene": scene.name, "renderer": context.info.renderer}
    report("ms of compiling for the first picture", rows, facts, options.json)


if __name__ == "__main__":
    run(main)
