"""Scripts whose pictures, windows and saved views are recorded."""

import re
from collections.abc import Iterable

from lab.benchmarks.behaviour.program import Run

PICTURE = ("--size", "480x270")
SMALL = ("WORK/scene/small.gltf", "--size", "480x270")
ALONE = ("WORK/alone/small.gltf", "--size", "480x270")
WINDOW = ("--size", "1100x700")
SCRIPTS: dict[str, tuple[tuple[str, ...], str]] = {
    "compare": (
        PICTURE,
        """window.panels; snap first; compare.mode a; snap a; compare.mode b; snap b; compare.mode wipe; compare.divider 0.3
        overlay.toggle; wait settled; file.screenshot-picture a side-a.png; file.screenshot-picture b side-b.png
        file.screenshot-picture split split.png; file.screenshot-picture plain plain.png
        kept side-a.png; kept side-b.png; kept split.png; kept plain.png; overlay.toggle
        snap divider; compare.mode wipe-horizontal; compare.divider 0.7; snap horizontal; compare.divider
        compare.mode side-by-side; snap side-by-side; compare.next; snap next; compare.mode difference
        compare.difference raw; snap raw; compare.difference amplified; compare.gain 12; snap amplified
        compare.difference relative; snap relative; compare.difference flip; wait seconds 15; snap flip
        compare.mode a; compare.swap; snap swapped; compare.measure; snap measured; compare.live off; compare.live on
        compare.flicker 5; wait frames 3; compare.flicker 0; snap flickered
        compare.toggle-flicker; wait frames 2; compare.toggle-flicker; snap toggled""",
    ),
    "slots": (
        PICTURE,
        """window.panels; compare.mode wipe; slot.source a clustered; slot.source b baseline; slot.path a cached
        slot.path b binned; slot.precision a fp16; snap both; compare.mode difference; snap differ; compare.mode a
        slot.next-source; snap source; slot.next-source; slot.next-path; snap path; slot.next-path; slot.next-path
        snap third; slot.precision a auto; snap precision; slot.path a auto; wait settled; slot.path a deferred; snap again
        slot.source b reference; compare.mode b; camera.go grazing; filter.anisotropy 16; snap anisotropic
        slot.path a cached; compare.mode a; snap anisotropic-tiles; filter.anisotropy 1; snap trilinear""",
    ),
    "overlay": (
        PICTURE,
        """window.panels; overlay.toggle; snap on; overlay.next-block; snap block; overlay.block 16x4; snap wide
        overlay.next-palette; snap palette; overlay.palette green-red; overlay.opacity 0.25; snap opacity
        slot.source b baseline; compare.mode wipe; snap wipe; overlay.kind error-texture; snap texture
        overlay.kind error-decoder; snap decoder; overlay.kind none; snap none; errors.highlight texture 3; snap highlight
        errors.highlight decoder 1; snap group; errors.highlight decoder 1; snap ended
        errors.highlight texture 24; errors.clear; snap clear; texture.select plaster_rose; snap selected
        texture.clear; snap unselected; overlay.kind divergence; overlay.opacity 1; pixel.panel; pixel.keep 200 150
        snap pixel; view.magnify 24 0.4 0.5; snap blocks""",
    ),
    "camera": (
        PICTURE,
        """window.panels; view.coarse-while-moving off; camera.next; snap next; camera.frame-all; snap all; camera.go market
        camera.bookmark here; snap market; camera.look 3 2 5 0 1 0; snap look; camera.look 3 2 5 0 1 0 30; snap narrow
        camera.go-bookmark here; camera.turntable 45; wait frames 40; camera.stop; snap turned
        camera.toggle-turntable; wait frames 10; camera.toggle-turntable; snap turned-on; camera.play WORK/path.json
        wait frames 90; snap played; camera.mode fly; snap fly; camera.next-mode; snap orbit; camera.record; wait frames 2
        camera.next; wait seconds 0.5; camera.next; wait seconds 0.5; camera.record; wait frames 2; camera.play
        wait frames 90; snap recorded; view.magnify 8 0.3 0.6; snap magnified; view.save saved.json; view.whole; snap whole
        view.copy; view.resolution 0.5; snap half; view.resolution 1; view.load saved.json; snap loaded; view.paste
        snap pasted; view.coarse-while-moving on; kept saved.json""",
    ),
    "keys": (
        SMALL,
        """key H; snap first; key Tab; snap tab; key X; snap x; key N; snap n; key P; snap p; key O; snap o; key B; snap b
        key L; snap l; key O; key C; snap c; key F; snap f; key 1; snap one; key 2; snap two; key V; snap v; hold W; wait frames 20
        release W; snap forward; hold Shift; hold D; wait frames 9; release D; release Shift; snap right; hold Q; wait frames 9
        release Q; snap down; drag 50% 50% 58% 45%; snap looked; wheel 2; key V; key 1; drag 50% 50% 60% 40%; snap orbited
        drag 50% 50% 45% 55% right; snap panned; drag 50% 50% 55% 45% middle; wheel 2; snap near; wheel -5; snap far
        move 40% 50%; hold Ctrl; wheel 5; snap glass; drag 40% 50% 50% 55%; release Ctrl; snap moved; key Z; snap z
        key Tab; key Tab; snap wipe; drag 50% 50% 70% 50%; snap divided; hold Space; wait frames 2; snap space; release Space
        key J; key J; key M; key I; move 45% 40%; wait settled; key U; snap panels; key Ctrl+C; key F; key Ctrl+V; snap pasted
        key Y; wait frames 12; key Y; snap turned; key ?; expect help on; key Escape; expect help off
        key Ctrl+P; type resolution; key Enter; type 0.5; key Enter; snap typed; size 300x200; snap small""",
    ),
    "panels": (
        WINDOW,
        """window.panel Timings off; window.panel Log off; compare.live off; shot first; window.panel Textures; shot textures
        window.panel Groups; shot groups; window.panel Training; shot training; window.panel Memory; shot memory
        overlay.toggle; move 50% 50%; shot divergence; pixel.panel; pixel.keep 200 150; shot pixel
        pixel.let-go; move 45% 45%; shot mouse; overlay.toggle; histogram.panel; shot histogram; errors.panel; shot errors
        errors.by decoder; errors.sort psnr best; shot decoders; errors.by texture; errors.sort name ascending; shot names""",
    ),
    "window": (
        WINDOW,
        """window.panel Timings off; window.panel Log off; compare.live off; help.palette; type path; shot palette; key Escape
        help.keys; shot keys; window.dismiss; click 'menu: View'; shot menu; key Escape; texture.select 5; shot selected
        texture.flat 5; shot flat; texture.close-flat; click 'A source'; click 'A source: single'; shot clicked
        window.theme light; shot light; window.ui-scale 1.5; shot large; window.ui-scale 1; window.theme dark
        size 640x480; shot little; size 1100x700; window.layout-reset; window.panel Timings off; window.panel Log off; shot reset
        file.screenshot window.png; kept window.png""",
    ),
    "figures": (
        WINDOW,
        """window.panel Timings off; window.panel Log off; compare.live on; compare.mode side-by-side; wait seconds 15; shot live
        file.quit; expect source never-reached""",
    ),
    "open": (
        ALONE,
        """window.panel Timings off; window.panel Log off; compare.live off; size 1000x700; shot offer
        file.open WORK/scene/small.single.ntc; wait seconds 6.5; shot pack; slot.source a single; shot shown; snap picture
        file.open WORK/scene/small.gltf; wait seconds 6.5; shot scene; snap packs""",
    ),
}
"""By name: what is opened, and lines as `played` reads them."""
TRAINING: dict[str, tuple[tuple[str, ...], str]] = {
    "encode": (
        ALONE,
        """window.panels; training.encode category auto 32 20steps paper; wait seconds PATIENCE; KEEP OUT/encoded.ntc
        wait seconds 2; snap encoded; kept encoded.ntc; compare.mode b; training.show 1 b; snap shown""",
    ),
    "retrain": (
        SMALL,
        """window.panels; slot.source a category; training.retrain 0 10steps; wait seconds PATIENCE
        KEEP OUT/retrained.ntc; wait seconds 2; snap retrained; kept retrained.ntc""",
    ),
    "anew": (
        ALONE,
        """window.panels; training.encode category; wait seconds PATIENCE; KEEP OUT/encoded.ntc; wait seconds 2
        training.anew 0 1.5; wait seconds PATIENCE; KEEP OUT/anew.ntc; wait seconds 2; snap anew; kept anew.ntc""",
    ),
    "move": (
        SMALL,
        """window.panels; slot.source a category; training.move 0 new 10steps paper; wait seconds PATIENCE
        KEEP OUT/moved.ntc; wait seconds 2; snap moved; kept moved.ntc""",
    ),
    "regroup": (
        SMALL,
        """window.panels; slot.source a single; training.regroup clustered 2 10steps; wait seconds PATIENCE; wait seconds 3
        KEEP OUT/regrouped.ntc; wait seconds 2; snap regrouped; kept regrouped.ntc""",
    ),
    "cancel": (
        SMALL,
        """window.panels; slot.source a single; training.encode single auto 32 100000steps paper; wait seconds PATIENCE; training.pause
        wait seconds 1; training.resume; wait seconds 1; training.cancel; wait seconds 3; training.discard; wait seconds 1
        slot.source a category; snap discarded""",
    ),
}
"""As SCRIPTS. A script cannot ask whether a training is done: it is played again with longer waits where it was not."""


def played(name: str, text: str, options: tuple[str, ...] = ("--size", "480x270"), keep: tuple[str, ...] = ()) -> Run:
    """A script. `snap NAME` in it takes the picture and the view, `shot NAME` the whole window, `file NAME` keeps a file."""
    lines = []
    kept = list(keep)
    for line in (part.strip() for part in re.split(r"[;\n]", text) if part.strip()):
        word, _, rest = line.partition(" ")
        if word == "snap":
            lines += [
                "wait settled",
                f"file.screenshot-picture shown {rest}.png",
                f"view.save {rest}.json",
                "wait frames 1",
            ]
            kept += [f"{rest}.png", f"{rest}.json"]
        elif word == "shot":
            # Thumbnails and distances of textures are there by then.
            lines += ["wait settled", "wait seconds 2", "wait settled", f"screenshot {rest}.png", "wait frames 1"]
            kept.append(f"{rest}.png")
        elif word == "kept":
            kept.append(rest)
        else:
            lines.append(line)
    script = "; ".join([*lines, "wait settled"] if "file.quit" not in lines else lines)
    return Run(name, ("view", "--headless", "--out", "OUT", *options, "--exec", script), tuple(kept))


def scripts() -> Iterable[Run]:
    """Every script of SCRIPTS."""
    yield from (played(name, text, options) for name, (options, text) in SCRIPTS.items())


def training() -> Iterable[Run]:
    """Every script of TRAINING."""
    yield from (played(name, text, options) for name, (options, text) in TRAINING.items())
