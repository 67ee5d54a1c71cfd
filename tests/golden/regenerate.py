"""Draw all golden pictures anew: `python -m tests.golden.regenerate`. Look at them before committing."""

import json

from ntc.io import write_text
from tests.golden.pictures import FOLDER, Studio
from viewer.scene.images import write_png


def main() -> None:
    """Replace the accepted pictures by new ones."""
    studio = Studio()
    for old in FOLDER.glob("*.png"):
        old.unlink()
    for picture in (*studio.pictures(), *studio.maps()):
        write_png(picture.path, studio.draw(picture))
    write_text(FOLDER / "renderer.json", json.dumps(studio.renderer_description(), indent=2) + "\n")


if __name__ == "__main__":
    main()
