"""Grouping by category (paper, Sec. 4): one decoder for each kind of material."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence

from ntc.codec.textures import SourceTexture
from ntc.pack.model import Grouping

KEYWORDS: dict[str, tuple[str, ...]] = {
    "aerial": ("aerial", "satellite"),
    "brick": ("brick", "bricks"),
    "roofing": ("roof", "roofing", "shingle", "shingles", "slates"),
    "wood": ("wood", "wooden", "plank", "planks", "parquet", "oak", "pine", "bark", "timber"),
    "metal": ("metal", "steel", "iron", "rust", "rusty", "copper", "brass", "aluminium", "aluminum", "chrome"),
    "fabric": ("fabric", "cloth", "carpet", "leather", "curtain", "linen", "wool", "awning", "denim"),
    "floor": ("floor", "tile", "tiles", "pavement", "paving", "cobble", "cobblestone", "cobbles"),
    "plaster": ("plaster", "stucco", "paint", "painted"),
    "concrete": ("concrete", "cement", "asphalt"),
    "rock": ("rock", "stone", "cliff", "marble", "granite"),
    "terrain": (
        "terrain",
        "ground",
        "grass",
        "sand",
        "dirt",
        "mud",
        "soil",
        "snow",
        "leaves",
        "gravel",
        "foliage",
        "moss",
    ),
}
"""Words by which a name without a label is put into one of the paper's categories; the first that fits counts."""
UNKNOWN = "other"


def guessed_category(name: str) -> str:
    """Category for a texture's name, or UNKNOWN."""
    words = set(re.sub(r"([a-z])([A-Z])", r"\1 \2", name).lower().replace("_", " ").replace("-", " ").split())
    words = {re.sub(r"[^a-z]", "", word) for word in words}
    return next((category for category, keys in KEYWORDS.items() if words & set(keys)), UNKNOWN)


def category_grouping(textures: Sequence[SourceTexture], labels: Mapping[int, str] | None = None) -> Grouping:
    """A group for each category: from `labels` (by index of the texture), else the texture's own label (glTF extras or
    folder name), else a guess from its name.

    The parameters say how many came from where.
    """
    listed = labels or {}
    chosen: list[str] = []
    sources: Counter[str] = Counter(listed=0, own=0, guessed=0, unknown=0)
    for index, texture in enumerate(textures):
        guess = guessed_category(texture.name)
        label = listed.get(index) or texture.category or guess
        chosen.append(label)
        if index in listed:
            sources["listed"] += 1
        elif texture.category is not None:
            sources["own"] += 1
        else:
            sources["unknown" if guess == UNKNOWN else "guessed"] += 1
    return Grouping.of_labels("category", chosen, {"categories": list(dict.fromkeys(chosen)), **sources})
