"""`ntc-viewer view`: the window; without a display, pictures in a folder."""

import sys
from pathlib import Path

from ntc.errors import InputError
from viewer.cli.doctor import has_display
from viewer.cli.options import RenderOptions, ViewOptions
from viewer.cli.render import render
from viewer.cli.sources import choose_source, open_scene, packs_for
from viewer.state.session import FirstLook
from viewer.state.view_state import REFERENCE

PICTURES_SIZE = (960, 540)


def draw_pictures(options: ViewOptions, folder: Path) -> None:
    """What the window would show first, as files: the decoded picture, the original, divergence and error."""
    common = {"scene": options.scene, "pack": options.pack, "size": PICTURES_SIZE}
    decoded = {"grouping": options.grouping, "path": options.path, "precision": options.precision}
    render(RenderOptions(out=folder / "decoded", overlay="divergence", **common, **decoded))  # type: ignore[arg-type]
    render(RenderOptions(out=folder / "original", grouping=REFERENCE, **common))  # type: ignore[arg-type]


def view(options: ViewOptions) -> int:
    """Run `ntc-viewer view`. Raises InputError for bad input."""
    from viewer.cli.play import play_headless, script_of

    if options.headless:
        return play_headless(options, options.out)
    script = script_of(options)
    if has_display():
        from viewer.app.window_app import WindowContent, run_window

        scene = open_scene(options.scene)
        packs = packs_for(scene, options.pack)
        source = choose_source(packs, options.grouping, options.pack)
        first = FirstLook(source, options.path, options.precision)
        return run_window(WindowContent(scene, packs, first, script, options.size, options.out))
    if script:
        raise InputError("no display (DISPLAY and WAYLAND_DISPLAY are unset) to play a script on; add --headless")
    sys.stdout.write("no display (DISPLAY and WAYLAND_DISPLAY are unset): drawing without a window\n")
    draw_pictures(options, options.out)
    sys.stdout.write(f"the pictures are in {options.out.resolve()}\n")
    return 0
