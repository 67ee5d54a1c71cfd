"""Warnings over the picture: missing files, and packs that do not match the scene. Neither is an error of the codec."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from ntc.codec.model import Pack
from ntc.pack.match import PackMatch
from viewer.inspect.memory_table import size_pairs, smaller_note
from viewer.scene.json_text import counted
from viewer.scene.model import Scene
from viewer.state.view_state import Slot

WHITE = (1.0, 1.0, 1.0, 1.0)
LONGEST_LINE = 90


@dataclass(frozen=True)
class PictureWarning:
    """Warning about the picture."""

    text: str
    remedy: str
    """Meaning of the warning, and what to do."""


def _short(line: str) -> str:
    """Return the file in a line of the report such as `images[0].uri: wood.png: cannot be read (...)`; of other lines, what fits."""
    named = re.match(r"(?:\S+\.uri: )?(.+?): (?:cannot be read|no such file)", line)
    line = named[1] if named is not None else line
    return line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 3].rstrip()}..."


def scene_warnings(scene: Scene) -> tuple[PictureWarning, ...]:
    """Return warnings about files and colours that the scene lacks."""
    warnings = []
    missing = scene.report.missing
    if missing:
        more = f", and {len(missing) - 1} more" if len(missing) > 1 else ""
        remedy = "These files or parts could not be read. The panel Scene lists all of them under 'missing'."
        warnings.append(PictureWarning(f"missing: {_short(missing[0])}{more}", remedy))
    plain = [material for material in scene.materials if material.texture_id < 0 and not material.missing_base]
    white = sum(material.factor == WHITE for material in plain)
    if white and 2 * white >= len(scene.materials):
        few = "the material has" if len(scene.materials) == 1 else f"{white} of {len(scene.materials)} materials have"
        remedy = "These surfaces are white. If the scene should have textures, look for their files."
        warnings.append(PictureWarning(f"{few} no base colour", remedy))
    return tuple(warnings)


def pack_warnings(side: str, scene: Scene, pack: Pack, match: PackMatch) -> tuple[PictureWarning, ...]:
    """Return warnings about differences between the scene and the pack of slot `A` or `B`."""
    warnings = []
    total = counted(len(match.texture_index), "texture")
    if match.changed:
        text = f"{side}: the pack is of another version of this scene ({len(match.changed)} of {total} differ)"
        warnings.append(PictureWarning(text, "Different textures are shown as originals. Encode the scene again."))
    elif match.absent:
        text = f"{side}: not in the pack: {len(match.absent)} of {total}"
        warnings.append(PictureWarning(text, "These textures are shown as originals."))
    if smaller := smaller_note(size_pairs(scene, pack, match)):
        remedy = "Part of the blur comes from the smaller textures, not from the codec. Encode at full size for a fair comparison."
        warnings.append(PictureWarning(f"{side}: {smaller}", remedy))
    return tuple(warnings)


def picture_warnings(
    scene: Scene,
    slots: Mapping[str, Slot],
    packs: Mapping[str, Pack],
    matches: Mapping[str, PackMatch],
    resolution: float,
) -> tuple[PictureWarning, ...]:
    """Return all warnings about the picture of `slots` by letter; `resolution` is the share of drawn pixels along a side."""
    warnings = list(scene_warnings(scene))
    for side, slot in slots.items():
        pack, match = packs.get(slot.source), matches.get(slot.source)
        if pack is not None and match is not None and len(match.texture_index) == len(scene.textures):
            warnings += pack_warnings(side, scene, pack, match)
    if resolution < 1.0:
        remedy = "Set it to 100 % in the panel Compare, or by the menu View."
        warnings.append(PictureWarning(f"preview: {resolution:.0%} of the pixels along each side", remedy))
    return tuple(warnings)
