"""Packs of a scene. Missing packs of a built-in scene are encoded at first use."""

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
    """Return the packs of a scene, opened by `packs_for`. A built-in scene without a pack of `grouping` is encoded in it.

    `usual`: grouping for a built-in scene without any pack, if `grouping` is None. Raises InputError for a pack that cannot be read,
    and for a named pack without a texture of the scene.
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
