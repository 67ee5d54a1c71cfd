"""Options of `ntc-viewer bench`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ntc.config import RecipeName
from viewer.commandline.options import OptionalScene, Packs, Size
from viewer.view_state import DecodePath, Precision


@dataclass(frozen=True)
class BenchOptions:
    """Time decoding: the worst case for a wave, and every pack, path and precision over the cameras of a scene."""

    json: Annotated[Path, tyro.conf.arg(metavar="F.json")]
    """The record. Tables (.md) and the plot of time against error (.png) are written beside it."""
    scene: OptionalScene = None
    """glTF scene. None: the built-in courtyard."""
    pack: Packs = ()
    """Packs to time besides those found beside the scene (NAME.*.ntc)."""
    what: Literal["all", "worst-case", "scene"] = "all"
    """What to time."""
    size: Size = (640, 360)
    """Pixels of the scene's pictures."""
    worst_size: Size = (512, 512)
    """Pixels of the worst case."""
    decoders: tuple[int, ...] = (1, 5, 10, 20)
    """Decoders that meet in every block of the worst case; each number in turn."""
    codec: RecipeName = "best"
    """Whose codec the worst case decodes."""
    paths: tuple[DecodePath, ...] = ("deferred", "forward", "binned")
    """Decode paths of the scene."""
    precisions: tuple[Precision, ...] = ("fp32", "fp16")
    """Storage of decoder weights."""
    views: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """JSON file of cameras. None: the scene's own, or the whole of it."""
    repeats: int = 5
    """Timed frames of each; figures are medians."""
