"""A newcomer's first minute in a real window on a virtual screen, with a picture of every step.

    python -m lab.window_trials.first_minute SCENE --out DIR [--size 1280x720] [--scale 1.0]

The window starts with nothing remembered: Space is held, the heatmap shown, the scene dropped and its encoding accepted, watched
and kept, and the program quit. It is started again without arguments, and what was kept is found among the recent files.
The scene's folder is copied first: the pack is written beside the scene.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from lab.window_trials.virtual_display import remembering_in, virtual_display

FIRST = """
wait settled
screenshot {out}/1-start.png
hold Space
wait frames 3
screenshot {out}/2-original.png
release Space
key O
wait settled
screenshot {out}/3-heatmap.png
key O
drop {scene}
wait settled
screenshot {out}/4-dropped.png
click "Encode it now"
wait seconds 6
move 60% 40%
screenshot {out}/5-encoding.png
wait trained
wait settled
screenshot {out}/6-encoded.png
click Accept
wait seconds 3
screenshot {out}/7-kept.png
file.quit
"""
AGAIN = """
wait settled
screenshot {out}/8-started-again.png
file.open {scene}
wait settled
expect source {source}
screenshot {out}/9-found-again.png
file.quit
"""
SECONDS = 600.0


def play(script: str, folder: Path, display: str, *arguments: str) -> None:
    """Play a script in a window whose settings and data lie in `folder`. Raises CalledProcessError."""
    file = folder / "script"
    file.write_text(script)
    subprocess.run(
        [sys.executable, "-m", "viewer", "view", "--script", str(file), *arguments],
        env=remembering_in(folder, display),
        timeout=SECONDS,
        check=True,
    )


def main() -> None:
    """Play both halves of the minute."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--scale", type=float, default=1.0)
    options = parser.parse_args()
    out = options.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    width, _, height = options.size.partition("x")
    with (
        tempfile.TemporaryDirectory(prefix="ntc-viewer-minute-") as name,
        virtual_display(int(width), int(height)) as display,
    ):
        folder = Path(name)
        shutil.copytree(options.scene.parent, folder / "scene")
        scene = folder / "scene" / options.scene.name
        (folder / "config").mkdir()
        (folder / "config" / "settings.json").write_text(f'{{"ui_scale": {options.scale}}}')
        play(FIRST.format(out=out, scene=scene), folder, display, "--size", options.size)
        play(AGAIN.format(out=out, scene=scene, source="clustered"), folder, display, "--size", options.size)


if __name__ == "__main__":
    main()
