"""Pictures and film of the guide: `python -m lab.documentation.tour` makes them in real windows on a virtual screen.

It plays docs/images/tour.script and docs/images/film.script with the built-in scenes and empty settings.
"""

import io
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageSequence

from lab.window_trials.virtual_display import remembering_in, virtual_display
from viewer.locations import assets_folder

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"
LARGEST = 300_000
"""Largest size of a picture in bytes."""
COLORS = (256, 192, 128, 96, 64, 48, 32)
"""Numbers of colours of a picture. The first one that makes it small enough is used."""
LARGEST_FILM = 1_200_000
"""Largest size of a film in bytes."""
QUALITIES = (70, 60, 50, 40, 30)
"""Qualities of a film that is too large. The first one that makes it small enough is used."""
RARE = 0.3
"""Share of the palette for rare colours, such as those of a legend."""


def reduced(picture: Path) -> bytes:
    """Return the picture as a PNG with the most of COLORS that stays below LARGEST bytes, or with the fewest."""
    image, data = Image.open(picture).convert("RGB"), b""
    for count in COLORS:
        rare, file, palette = int(RARE * count), io.BytesIO(), Image.new("P", (1, 1))
        common = image.quantize(count - rare).getpalette() or []
        palette.putpalette(common + (image.quantize(rare, Image.Quantize.MAXCOVERAGE).getpalette() or []))
        image.quantize(palette=palette, dither=Image.Dither.NONE).save(file, "PNG", optimize=True)
        data = file.getvalue()
        if len(data) < LARGEST:
            break
    return data


def reduced_film(film: Path) -> bytes:
    """Return the film unchanged, or at the first of QUALITIES that makes it at most LARGEST_FILM bytes."""
    data, qualities = film.read_bytes(), iter(QUALITIES)
    while len(data) > LARGEST_FILM and (quality := next(qualities, None)) is not None:
        frames, times = [], []
        for frame in ImageSequence.Iterator(Image.open(film)):
            frames.append(frame.convert("RGB"))
            times.append(frame.info["duration"])
        file = io.BytesIO()
        frames[0].save(file, "WEBP", save_all=True, append_images=frames[1:], duration=times, quality=quality, method=4)
        data = file.getvalue()
    return data


def play(script: Path, folder: Path, display: str) -> Path:
    """Play a script in a new window, and return the folder of its pictures."""
    work, made = folder / script.stem, folder / f"{script.stem} pictures"
    for each in (work, made / script.stem):
        each.mkdir(parents=True)
    shutil.copy(assets_folder() / "gallery.glb", work / "my-scene.glb")
    lines = script.read_text().replace("drop assets/", f"drop {assets_folder()}/")
    played = folder / script.name
    played.write_text(f"{lines}\nfile.quit\n")
    command = [sys.executable, "-m", "viewer", "view", "--script", str(played), "--out", str(made)]
    environment = {**remembering_in(folder / f"{script.stem} state", display), "PYTHONPATH": str(IMAGES.parents[1])}
    subprocess.run(command, cwd=work, env=environment, check=True)
    return made


def main() -> None:
    """Make the pictures of all scripts, or of the scripts in the arguments."""
    names = sys.argv[1:] or ["tour", "film"]
    with tempfile.TemporaryDirectory(prefix="ntc-viewer-") as name, virtual_display(1280, 720) as display:
        for script in names:
            made = play(IMAGES / f"{script}.script", Path(name), display)
            for picture in sorted(made.rglob("*.*")):
                out = IMAGES / picture.relative_to(made)
                out.write_bytes(reduced(picture) if picture.suffix == ".png" else reduced_film(picture))
                sys.stdout.write(f"{out.name}: {out.stat().st_size:,} bytes\n")


if __name__ == "__main__":
    main()
