"""A program of its own: a window in which a panel fails in the midst of a table. Run by test_real_window.py."""

import sys
from pathlib import Path

from viewer.app import window_app as app
from viewer.gl.thumbnails import Thumbnails
from viewer.scene.load import load_scene
from viewer.script.parse import parse_script
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.session import FirstLook


def fails(*_: object) -> None:
    """Stands for a mistake."""
    raise RuntimeError("a mistake of this program")


def main() -> None:
    """Open the scene named first, and bring the panel to the front."""
    path, pictures = Path(sys.argv[1]), Path(sys.argv[2])
    Thumbnails.__getitem__ = fails  # type: ignore[method-assign, assignment]
    script = parse_script("wait frames 5\nwindow.panel Textures on\nwait frames 30\nwindow.close", "broken")
    packs = open_packs(packs_beside(path))
    app.run_window(app.WindowContent(load_scene(path), packs, FirstLook(), script, size=(900, 500), pictures=pictures))


if __name__ == "__main__":
    main()
