"""`ntc-viewer view --headless`: a script is played without a window."""

from collections.abc import Sequence
from pathlib import Path

from ntc.errors import InputError
from viewer.cli.options import ViewOptions
from viewer.cli.precision import resolve_precision
from viewer.cli.sources import choose_source, open_scene, packs_for
from viewer.script.directions import LARGEST_SIDE, SMALLEST_SIDE
from viewer.script.parse import Script, parse_exec, read_script
from viewer.state.session import FirstLook

WITHOUT_SCRIPT = "wait settled; screenshot window.png"
"""What is played where nothing is given: one picture."""


def script_of(options: ViewOptions) -> Script:
    """The script that the options ask for, empty for none. Raises InputError before anything is opened."""
    parts: Sequence[Script] = (
        *((read_script(options.script),) if options.script is not None else ()),
        *(parse_exec(text) for text in options.exec),
    )
    return tuple(step for part in parts for step in part)


def play_headless(options: ViewOptions, pictures: Path) -> int:
    """Play the script of `options` without a window. Raises InputError where it, or one of its lines, is wrong."""
    from viewer.app.headless import HeadlessApp

    if options.size is not None and not all(SMALLEST_SIDE <= side <= LARGEST_SIDE for side in options.size):
        raise InputError(f"--size: each side must be {SMALLEST_SIDE} to {LARGEST_SIDE} pixels")
    script = script_of(options) or parse_exec(WITHOUT_SCRIPT)
    scene = open_scene(options.scene)
    packs = packs_for(scene, options.pack)
    source = choose_source(packs, options.grouping, options.pack)
    first = FirstLook(source, options.path, resolve_precision(options.precision, packs.get(source), None))
    app = HeadlessApp(scene, packs, options.size or (1280, 720), pictures, first=first)
    try:
        app.play(script)
    finally:
        app.close()
    return 0
