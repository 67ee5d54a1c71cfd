"""Grouping by category (paper, Sec. 4): one decoder for each kind of material."""

import re
from collections.abc import Sequence

from ntc.grouping.order import in_order_of_appearance
from ntc.pack import Grouping
from ntc.textures import SourceTexture

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


def category_grouping(textures: Sequence[SourceTexture]) -> Grouping:
    """A group for each category: the texture's own label where it has one, else a guess from its name.

    The parameters say how many labels were given, guessed and unknown.
    """
    labels = [texture.category or guessed_category(texture.name) for texture in textures]
    names = sorted(set(labels))
    given = sum(texture.category is not None for texture in textures)
    unknown = sum(
        texture.category is None and label == UNKNOWN for texture, label in zip(textures, labels, strict=True)
    )
    groups = in_order_of_appearance([names.index(label) for label in labels])
    in_order = list(dict.fromkeys(labels))
    parameters = {
        "categories": in_order,
        "given": given,
        "guessed": len(textures) - given - unknown,
        "unknown": unknown,
    }
    return Grouping("category", groups, parameters)
