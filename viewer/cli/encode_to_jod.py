"""`ntc-viewer encode --quality 9.5jod`: the fewest bits at which every lit view reaches a JOD.

Quality rises with bits, so the search doubles or halves the bitrate until one trial reaches the goal and one does not, and then
bisects on a logarithmic scale. Each trial encodes the scene, draws lit views and takes the worst JOD of ColorVideoVDP.
"""

import math
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from ntc.codec.model import Pack
from ntc.content_cache import ContentCache
from ntc.errors import InputError
from ntc.metrics.metrics import bits_with_mips
from ntc.metrics.perceptual import INSTALL, has_jod
from ntc.pack.file import read_pack, write_pack
from viewer.checking.views import LIGHTS, ViewsToMeasure, measured_views
from viewer.cli.options import EncodeOptions
from viewer.cli.sources import open_scene
from viewer.gl.context import create_headless_context
from viewer.locations import named_scene
from viewer.scene.cameras_file import with_cameras_beside
from viewer.scene.json_text import counted
from viewer.state.framing import frame_all

FEWEST_BITS, MOST_BITS = 0.75, 16.0
"""Range of bits per texel that is searched."""
FIRST_BITS = 3.0
NEAR = 1.08
"""Ratio of bits at which the search ends: smaller steps change JOD by less than its noise."""
MOST_CAMERAS = 3
SIZE = (960, 540)
"""(width, height) of the measured pictures in pixels."""


@dataclass(frozen=True, eq=False)
class Trial:
    """Encoded pack with its measured quality."""

    bits: float
    """Target bitrate in bits per texel."""
    jod: float
    """JOD of the worst view."""
    pack: Pack


def fewest_bits(measure: Callable[[float], Trial], goal: float) -> Trial:
    """Return the trial with the fewest bits whose JOD is at least `goal`.

    Raises InputError where MOST_BITS do not reach it.
    """
    good: Trial | None = None
    poor: Trial | None = None
    bits = FIRST_BITS
    while good is None or poor is None:
        trial = measure(bits)
        if trial.jod >= goal:
            good = trial
            if bits <= FEWEST_BITS:
                return good
            bits = max(bits / 2.0, FEWEST_BITS)
        else:
            poor = trial
            if bits >= MOST_BITS:
                raise InputError(
                    f"--quality {goal:g}jod: {bits:g} bits per texel give {trial.jod:.2f} JOD; ask for less"
                )
            bits = min(bits * 2.0, MOST_BITS)
    while good.bits > poor.bits * NEAR:
        trial = measure(math.sqrt(good.bits * poor.bits))
        if trial.jod >= goal:
            good = trial
        else:
            poor = trial
    return good


def encode_to_jod(options: EncodeOptions, goal: float, encode_pack: Callable[[EncodeOptions], object]) -> int:
    """Run `ntc-viewer encode` for a goal in JOD. `encode_pack` writes the pack of options with a target bitrate.

    Raises InputError for bad input.
    """
    if not 0.0 < goal < 10.0:
        raise InputError(f"--quality {goal:g}jod: set it above 0 and below 10 JOD, which equal pictures have")
    if not has_jod():
        raise InputError(f"--quality {goal:g}jod: needs ColorVideoVDP; {INSTALL}")
    if options.source.is_dir() or options.out.suffix == "" or options.workers is not None or options.ray is not None:
        raise InputError(f"--quality {goal:g}jod: needs a scene and one pack; give dB or --bits otherwise")
    scene = with_cameras_beside(open_scene(named_scene(options.source)))
    cameras = (scene.cameras or (frame_all(scene),))[:MOST_CAMERAS]
    context = create_headless_context()
    with tempfile.TemporaryDirectory() as folder, context.reset.watched():
        place = Path(folder, options.out.name)
        cache = ContentCache(Path(folder))

        def measure(bits: float) -> Trial:
            encode_pack(replace(options, quality=None, bits=bits, out=place))
            pack = read_pack(place)
            views = ViewsToMeasure(scene, pack.grouping.name, pack, cameras, SIZE, f"{bits!r}")
            records = measured_views(context, views, cache).records
            trial = Trial(bits, min(each.jod for each in records if each.jod is not None), pack)
            sys.stderr.write(f"{bits_with_mips(pack):.2f} bits per texel: {trial.jod:.2f} JOD\n")
            return trial

        best = fewest_bits(measure, goal)
    write_pack(options.out, best.pack)
    views = counted(len(cameras) * len(LIGHTS), "lit view")
    sys.stdout.write(
        f"quality: {best.jod:.2f} JOD in the worst of {views}, as asked at least {goal:g}\n"
        f"bits: {bits_with_mips(best.pack):.2f} per texel of mip 0\nwrote {options.out}\n"
    )
    return 0
