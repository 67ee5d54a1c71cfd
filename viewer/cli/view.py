"""`ntc-viewer view`: opens the window; without a display, writes pictures into a folder."""

import sys
from collections.abc import Sequence
from pathlib import Path

from ntc.codec.config import PrecisionChoice
from ntc.errors import InputError
from viewer.cli.builtin_packs import packs_with
from viewer.cli.doctor import has_display
from viewer.cli.options import RenderOptions, ViewOptions
from viewer.cli.render import render
from viewer.cli.sources import choose_source, open_scene, resolve_precision
from viewer.gl.systems import SYSTEM
from viewer.script.directions import LARGEST_SIDE, SMALLEST_SIDE
from viewer.script.script import Script, parse_exec, read_script
from viewer.state.open_files import InitialView
from viewer.state.pack_files import PREFERRED_GROUPING
from viewer.state.view_state import REFERENCE

PICTURES_SIZE = (960, 540)
WITHOUT_SCRIPT = "wait settled; screenshot window.png"
"""Script of --headless without --script and --exec: one picture."""


def draw_pictures(options: ViewOptions, folder: Path) -> None:
    """Write the decoded picture with its divergence, and the original picture, into `folder`."""
    # The view that the window opens with.
    common = {
        "scene": options.scene,
        "pack": options.pack,
        "size": PICTURES_SIZE,
        "view": "lit",
        "device": options.device,
    }
    common |= {"decoder_variant": options.decoder_variant}
    slot = {"path": options.path, "precision": options.precision, "filter": options.filter or "exact"}
    decoded = {"grouping": options.grouping, **slot}
    render(RenderOptions(out=folder / "decoded", overlay="divergence", **common, **decoded))  # type: ignore[arg-type]
    render(RenderOptions(out=folder / "original", grouping=REFERENCE, **common))  # type: ignore[arg-type]


def script_of(options: ViewOptions) -> Script:
    """Return the script of --script and --exec, empty for none. Raises InputError for a script that is wrong."""
    parts: Sequence[Script] = (
        *((read_script(options.script),) if options.script is not None else ()),
        *(parse_exec(text) for text in options.exec),
    )
    return tuple(step for part in parts for step in part)


def _initial(options: ViewOptions, source: str, precision: PrecisionChoice) -> InitialView:
    return InitialView(source, options.path, precision, options.filter, decoder_variant=options.decoder_variant)


def play_headless(options: ViewOptions, pictures: Path) -> int:
    """Play the script of `options` without a window. Raises InputError for a wrong script, and where a line of it fails."""
    from viewer.app.headless import HeadlessApp

    if options.size is not None and not all(SMALLEST_SIDE <= side <= LARGEST_SIDE for side in options.size):
        raise InputError(f"--size: each side must be {SMALLEST_SIDE} to {LARGEST_SIDE} pixels")
    script = script_of(options) or parse_exec(WITHOUT_SCRIPT)
    scene = open_scene(options.scene)
    packs = packs_with(scene, options.pack, options.grouping)
    source = choose_source(packs, options.grouping, options.pack)
    precision = resolve_precision(options.precision, packs.get(source))
    initial = _initial(options, source, precision)
    app = HeadlessApp(scene, packs, options.size or (1280, 720), pictures, initial=initial, device=options.device)
    try:
        app.play(script)
    finally:
        app.close()
    return 0


def view(options: ViewOptions) -> int:
    """Run `ntc-viewer view`. Raises InputError for bad input."""
    if options.headless:
        return play_headless(options, options.out)
    script = script_of(options)
    if has_display():
        if options.device is not None:
            raise InputError(f"--device {options.device}: the GPU of a window is not chosen here; {SYSTEM.window_gpu}")
        from viewer.app.window_app import WindowContent, run_window

        scene = open_scene(options.scene)
        packs = packs_with(scene, options.pack, options.grouping, PREFERRED_GROUPING)
        source = choose_source(packs, options.grouping, options.pack)
        initial = _initial(options, source, options.precision)
        return run_window(WindowContent(scene, packs, initial, script, options.size, options.out))
    if script:
        raise InputError("no display (DISPLAY and WAYLAND_DISPLAY are unset) to play a script on; add --headless")
    sys.stdout.write("no display (DISPLAY and WAYLAND_DISPLAY are unset): drawing without a window\n")
    draw_pictures(options, options.out)
    sys.stdout.write(f"the pictures are in {options.out.resolve()}\n")
    return 0
