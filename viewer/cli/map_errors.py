"""What `render --error-by-map` writes: figures and pictures of the error that each decoded map alone makes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from viewer.capture.pictures import ERROR_AMPLIFICATION
from viewer.inspect.measurement import MapError
from viewer.scene.images import write_png
from viewer.scene.model import Scene


def map_error_statistics(errors: Sequence[MapError], scene: Scene) -> dict[str, dict[str, Any]]:
    """What stats.json holds, by map: PSNR in dB and mean squared error (squared 8-bit steps) of the picture, and the texture that has
    most of the error, with its share. Null where there is none."""
    found = {}
    for error in errors:
        total = float(error.by_texture.sum())
        worst = int(error.by_texture.argmax()) if total > 0.0 else None
        found[str(error.maps)] = {
            "psnr_db": error.psnr_db,
            "mean_squared_error": error.mean_squared_error,
            "worst_texture": None if worst is None else scene.textures[worst].name,
            "share_of_worst_texture": None if worst is None else float(error.by_texture[worst]) / total,
        }
    return found


def write_map_errors(folder: Path, errors: Sequence[MapError]) -> None:
    """Write error.MAP.png for each map: the error of every pixel, amplified as in the error overlay, black where there is none."""
    for error in errors:
        steps = np.minimum(np.sqrt(error.squared_error) * ERROR_AMPLIFICATION, 255.0)
        write_png(folder / f"error.{error.maps}.png", np.rint(steps).astype(np.uint8))
