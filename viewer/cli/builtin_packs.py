"""Packs of a scene, with those of a built-in scene that are encoded when they are first asked for."""

from pathlib import Path
from typing import get_args

from ntc.codec.config import GroupingName
from ntc.codec.model import Pack
from viewer.cli.sources import packs_for
from viewer.locations import is_builtin
from viewer.scene.model import Scene
from viewer.state.pack_files import open_packs, source_of_grouping


def packs_with(
    scene: Scene, named: tuple[Path, ...], grouping: str | None, usual: GroupingName | None = None
) -> dict[str, Pack]:
    """Open the packs of a scene as `packs_for` does. A built-in scene that has no pack of `grouping` yet is encoded in it.

    `usual`: grouping that a built-in scene is encoded in where none is asked for and it has no pack at all.

    Raises InputError for a pack that cannot be read, or that is named and holds no texture of the scene.
    """
    packs = packs_for(scene, named)
    if grouping is None and not packs:
        grouping = usual
    missing = next((name for name in get_args(GroupingName) if name == grouping), None)
    if missing and scene.path is not None and is_builtin(scene.path) and source_of_grouping(packs, missing) is None:
        # Encoding takes torch, which takes a second to import.
        from viewer.cli.encode import encode_builtin

        packs |= open_packs([encode_builtin(scene.path, missing)])
    return packs
