"""Packs of a scene: those that are named, and `NAME.*.ntc` beside `NAME.glb`."""

import os
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass
from itertools import chain, count
from pathlib import Path
from weakref import WeakKeyDictionary

from ntc.codec.config import GroupingName
from ntc.codec.model import Pack
from ntc.codec.quality import finite_or_none
from ntc.library.index import is_library, library_packs
from ntc.metrics.metrics import psnr_table
from ntc.pack.file import read_pack
from ntc.pack.match import PackMatch, match_pack
from viewer.locations import packs_folder
from viewer.scene.model import Scene, SceneTexture
from viewer.scene.scene_files import PACK_SUFFIX, scenes_in
from viewer.state.view_state import REFERENCE, ViewState, is_image_source

PREFERRED_GROUPING: GroupingName = "clustered"
_FIGURES: WeakKeyDictionary[Pack, "PackFigures"] = WeakKeyDictionary()
MOST_OF_A_LIBRARY = 4
"""Largest number of packs from a library: one for each way in which it holds a scene's textures."""


def match_scene(pack: Pack, scene: Scene) -> PackMatch:
    """Return which textures of `scene` are in `pack`."""
    return match_pack(
        pack, [_hashes(texture) for texture in scene.textures], [texture.name for texture in scene.textures]
    )


@dataclass(frozen=True)
class PackFigures:
    """Size and quality of a pack."""

    bits: float
    """Stored bits per texel of mip 0, mips and decoders included."""
    bytes: int
    """Bytes of latents and decoders."""
    psnr_db: float | None
    """PSNR in dB of the mean square error of mip 0 of all textures; None where it is unknown."""


def pack_figures(pack: Pack) -> PackFigures:
    """Return size and quality of `pack`; they are computed once."""
    figures = _FIGURES.get(pack)
    if figures is None:
        table = psnr_table(pack)
        size = table.latent_bytes + table.decoder_bytes + table.adapter_bytes
        known = table.summary if all(texture.psnr_db is not None for texture in pack.textures) else None
        psnr = finite_or_none(known.of_mean_mse_db) if known is not None else None
        figures = _FIGURES[pack] = PackFigures(table.bits_per_texel, size, psnr)
    return figures


def pack_label(pack: Pack) -> str:
    """Return what a pack is in a few words: `clustered, 4.0 bits, 39.3 dB, 2.1 MB`."""
    figures = pack_figures(pack)
    quality = "" if figures.psnr_db is None else f", {figures.psnr_db:.1f} dB"
    return f"{pack.grouping.name}, {figures.bits:.1f} bits{quality}, {figures.bytes / 1e6:.2g} MB"


def source_label(source: str, packs: Mapping[str, Pack]) -> str:
    """Return a source with what it is: `run 2: clustered, 4.0 bits, 39.3 dB, 2.1 MB`; images have no more than their name."""
    if source not in packs:
        return source
    label = pack_label(packs[source])
    return label if source == packs[source].grouping.name else f"{source}: {label}"


def source_of_grouping(packs: Mapping[str, Pack], grouping: str) -> str | None:
    """Return the name of the open pack that is called `grouping` or has that grouping; None without one."""
    return next((name for name, pack in packs.items() if grouping in (name, pack.grouping.name)), None)


def preferred_source(packs: Mapping[str, Pack], last: str = "") -> str:
    """Return the default source: the pack of the file `last`, else the clustered pack, else the first, else the reference."""
    if last:
        of_file = (name for name, pack in packs.items() if pack.path is not None and same_place(pack.path, Path(last)))
        if (name := next(of_file, None)) is not None:
            return name
    return PREFERRED_GROUPING if PREFERRED_GROUPING in packs else next(iter(packs), REFERENCE)


def base_pack_name(view: ViewState, packs: Mapping[str, Pack]) -> str | None:
    """Return the name of the pack that a training continues: slot A's, else slot B's, else the first open one; None without one."""
    shown = (slot.source for slot in (view.slot_a, view.slot_b))
    return next((source for source in shown if source in packs), next(iter(packs), None))


def packs_of(scene: Scene) -> tuple[Path, ...]:
    """Return the packs that open with a scene, each once: those that its file names, then those beside it."""
    paths = (*scene.packs, *(packs_beside(scene.path) if scene.path is not None else ()))
    return _once(paths)


def _once(paths: Iterable[Path]) -> tuple[Path, ...]:
    """Return each file once, at its first path, whatever links lead to it."""
    return tuple({os.path.realpath(path): path for path in reversed(tuple(paths))}.values())[::-1]


def packs_beside(scene_path: Path) -> tuple[Path, ...]:
    """Return the packs beside a scene file: `NAME.ntc` and `NAME.*.ntc`, in alphabetical order.

    For a built-in scene, packs that the user has saved follow.
    """
    folders = dict.fromkeys((scene_path.parent, packs_folder(scene_path)))
    return tuple(path for folder in folders for path in _packs_in(folder, scene_path.stem))


def scenes_with_pack(pack_path: Path) -> tuple[Path, ...]:
    """Return the scene files beside `pack_path` that open a pack of that name, in alphabetical order; the pack need not be there."""
    try:
        scenes = scenes_in(pack_path.parent)
    except OSError:
        return ()
    return tuple(scene for scene in scenes if _is_pack_of(pack_path, scene.stem))


def _is_pack_of(path: Path, stem: str) -> bool:
    return path.suffix == PACK_SUFFIX and (path.stem == stem or path.name.startswith(f"{stem}."))


def _packs_in(folder: Path, stem: str) -> tuple[Path, ...]:
    try:
        return tuple(sorted(path for path in folder.iterdir() if _is_pack_of(path, stem) and path.is_file()))
    except OSError:
        # The scene can still be opened where the folder cannot be listed, or is not there.
        return ()


def same_place(first: Path, second: Path) -> bool:
    """Return True where both paths are the same file once links are resolved."""
    return os.path.realpath(first) == os.path.realpath(second)


def wanted_textures(scene: Scene) -> frozenset[str]:
    """Return the hashes by which a pack may hold a texture of `scene`."""
    return frozenset(digest for texture in scene.textures for digest in _hashes(texture))


def _hashes(texture: SceneTexture) -> list[str]:
    return [digest for digest in (texture.packed_hash, texture.set_hash, texture.pixel_hash) if digest]


def read_packs(path: Path, wanted: Container[str]) -> list[Pack]:
    """Read the pack at `path`, or packs of the textures with `wanted` hashes from a library there, the fullest first.

    Raises InputError for a file that cannot be read.
    """
    return library_packs(path, wanted, MOST_OF_A_LIBRARY) if is_library(path) else [read_pack(path)]


def open_packs(paths: Iterable[Path], wanted: Container[str] = ()) -> dict[str, Pack]:
    """Read packs and name each by its grouping; a second pack of one grouping is named by its file. Libraries give what is
    `wanted` (`read_packs`).

    Raises InputError where a file cannot be read.
    """
    packs: dict[str, Pack] = {}
    for path in _once(paths):
        for pack in read_packs(path, wanted):
            packs[unused_name(pack.grouping.name, path, packs)] = pack
    return packs


def unused_name(grouping: str, path: Path, packs: Container[str]) -> str:
    """Return a name for the pack read from `path` that no other open pack has."""
    candidates = (grouping, path.stem, str(path))
    numbered = (f"{path} ({number})" for number in count(2))
    return next(name for name in chain(candidates, numbered) if name not in packs and not is_image_source(name))
