"""Which packs are open for a scene: those named, and `NAME.*.ntc` beside `NAME.glb`."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from ntc.pack import Pack
from ntc.pack_file import read_pack
from viewer.view_state import REFERENCE


def packs_beside(scene_path: Path) -> tuple[Path, ...]:
    """The packs that lie beside a scene file: `NAME.ntc` and `NAME.*.ntc`, in alphabetical order."""
    stem, folder = scene_path.stem, scene_path.parent
    if not folder.is_dir():
        return ()
    return tuple(
        sorted(
            path
            for path in folder.iterdir()
            if path.suffix == ".ntc" and (path.stem == stem or path.name.startswith(f"{stem}.")) and path.is_file()
        )
    )


def open_packs(paths: Iterable[Path]) -> dict[str, Pack]:
    """Read packs and name each by its grouping; a second pack of one grouping gets its file name as name.

    Raises InputError where a file cannot be read.
    """
    packs: dict[str, Pack] = {}
    seen: set[Path] = set()
    for path in paths:
        if path.resolve() in seen:
            continue
        seen.add(path.resolve())
        pack = read_pack(path)
        packs[unused_name(pack.grouping.name, path, packs)] = pack
    return packs


def unused_name(grouping: str, path: Path, packs: Mapping[str, Pack]) -> str:
    """Name for a pack read from `path` that no other open pack has."""
    candidates = (grouping, path.stem, str(path))
    return next((name for name in candidates if name not in packs and name != REFERENCE), f"{path} ({len(packs)})")
