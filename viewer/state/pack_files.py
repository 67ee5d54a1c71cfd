"""Packs of a scene: those that are named, and `NAME.*.ntc` beside `NAME.glb`."""

import os
from collections.abc import Container, Iterable, Mapping
from itertools import chain, count
from pathlib import Path

from ntc.codec.model import Pack
from ntc.library.index import is_library
from ntc.library.reading import library_packs
from ntc.pack.file import read_pack
from ntc.pack.match import PackMatch, match_pack
from viewer.locations import packs_folder
from viewer.scene.model import Scene, SceneTexture
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.state.view_state import REFERENCE, ViewState, is_image_source

PREFERRED_GROUPING = "clustered"
MOST_OF_A_LIBRARY = 4
"""Largest number of packs from a library: one for each way in which it holds a scene's textures."""


def match_scene(pack: Pack, scene: Scene) -> PackMatch:
    """Return which textures of `scene` are in `pack`."""
    return match_pack(
        pack, [_hashes(texture) for texture in scene.textures], [texture.name for texture in scene.textures]
    )


def source_of_grouping(packs: Mapping[str, Pack], grouping: str) -> str | None:
    """Return the name of the open pack that is called `grouping` or has that grouping; None without one."""
    return next((name for name, pack in packs.items() if grouping in (name, pack.grouping.name)), None)


def preferred_source(packs: Mapping[str, Pack]) -> str:
    """Return the default source: the clustered pack, else the first, else the reference."""
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

    For a built-in scene, packs that the user has accepted follow.
    """
    folders = dict.fromkeys((scene_path.parent, packs_folder(scene_path)))
    return tuple(path for folder in folders for path in _packs_in(folder, scene_path.stem))


def _packs_in(folder: Path, stem: str) -> tuple[Path, ...]:
    try:
        return tuple(
            sorted(
                path
                for path in folder.iterdir()
                if path.suffix == PACK_SUFFIX
                and (path.stem == stem or path.name.startswith(f"{stem}."))
                and path.is_file()
            )
        )
    except OSError:
        # The scene can still be opened where the folder cannot be listed, or is not there.
        return ()


def same_place(first: Path, second: Path) -> bool:
    """Return True where both paths are the same file once links are resolved."""
    return os.path.realpath(first) == os.path.realpath(second)


def wanted_textures(scene: Scene) -> frozenset[str]:
    """Return the hashes by which a pack may hold a texture of `scene`."""
    return frozenset(own for texture in scene.textures for own in _hashes(texture))


def _hashes(texture: SceneTexture) -> list[str]:
    return [own for own in (texture.packed_hash, texture.set_hash, texture.pixel_hash) if own]


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
