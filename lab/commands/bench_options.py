"""Options of `ntc-viewer bench`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from ntc.codec.config import RecipeName
from viewer.cli.options import OptionalScene, Packs, Size, Sizes
from viewer.state.view_state import DecodePath, Precision


@dataclass(frozen=True)
class BenchOptions:
    """Time decoding: the worst case for a wave; every pack, path and precision over a scene's cameras; how time grows."""

    json: Annotated[Path, tyro.conf.arg(metavar="F.json")]
    """The record. Tables (.md) and plots (.png) are written beside it, each as soon as it is done."""
    scene: OptionalScene = None
    """glTF scene. None: the built-in courtyard."""
    pack: Packs = ()
    """Packs to time besides those found beside the scene (NAME.*.ntc)."""
    what: Literal["all", "worst-case", "scene", "scaling"] = "all"
    """What to time."""
    size: Size = (640, 360)
    """Pixels of the scene's pictures."""
    worst_sizes: Sizes | None = None
    """Pixels of the worst case, each size in turn. None: 512x512, and on a GPU its doubles up to 8192x8192."""
    decoders: tuple[int, ...] = (1, 5, 10, 20)
    """Decoders that meet in every block of the worst case; each number in turn."""
    scaling_sizes: Sizes | None = None
    """Pictures of the scaling; the middle one serves the other sweeps. None: 256x256 to 1024x1024, on a GPU to 4096x4096."""
    scaling_textures: tuple[int, ...] = (1, 10, 100, 500, 2000)
    """Textures of the scaling."""
    scaling_decoders: tuple[int, ...] = (1, 10, 100, 500, 2000)
    """Decoders of the scaling."""
    scaling_widths: tuple[int, ...] = (16, 32, 64, 128)
    """Hidden neurons of the scaling: multiples of 4, at most 256."""
    codec: RecipeName = "best"
    """Whose codec the worst case and the scaling decode."""
    hidden_width: int | None = None
    """Neurons of each hidden layer of that codec. None: the recipe's."""
    memory_mb: int = 4096
    """MiB that pictures may take: larger ones of worst case and scaling are decoded in tiles, one of a scene is refused."""
    paths: tuple[DecodePath, ...] = get_args(DecodePath)
    """Decode paths of the scene."""
    precisions: tuple[Precision, ...] = get_args(Precision)
    """Storage of decoder weights and arithmetic with them. All of them: those that the driver has."""
    views: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """JSON file of cameras. None: the scene's own, or the whole of it."""
    repeats: int = 5
    """Timed frames of each; figures are medians."""
