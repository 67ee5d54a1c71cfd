"""Grouping `category` (paper, Sec. 4): one decoder for each kind of material. Categories come from a CSV file, labels or names."""

import csv
import io
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath

from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError

KEYWORDS: dict[str, str] = {
    "aerial": "aerial satellite",
    "brick": "brick bricks",
    "roofing": "roof roofing shingle shingles slates",
    "wood": "wood wooden plank planks parquet oak pine bark timber",
    "metal": "metal steel iron rust rusty copper brass aluminium aluminum chrome",
    "fabric": "fabric cloth carpet leather curtain linen wool awning denim",
    "floor": "floor tile tiles pavement paving cobble cobblestone cobbles",
    "plaster": "plaster stucco paint painted",
    "concrete": "concrete cement asphalt",
    "rock": "rock stone cliff marble granite",
    "terrain": "terrain ground grass sand dirt mud soil snow leaves gravel foliage moss",
}
"""Words of a texture's name that put it into one of the paper's categories; the first category that matches counts."""
UNKNOWN = "other"
TEXTURE_COLUMNS = ("texture", "name", "file")
CATEGORY_COLUMN = "category"
LARGEST_FILE = 16 * 2**20
"""Bytes."""
LONGEST_NAME = 200
UNKNOWN_SHOWN = 3


def guessed_category(name: str) -> str:
    """Return the category that a texture's name suggests, or UNKNOWN."""
    words = set(re.sub(r"([a-z])([A-Z])", r"\1 \2", name).lower().replace("_", " ").replace("-", " ").split())
    words = {re.sub(r"[^a-z]", "", word) for word in words}
    return next((category for category, keys in KEYWORDS.items() if words & set(keys.split())), UNKNOWN)


def category_grouping(textures: Sequence[SourceTexture], labels: Mapping[int, str] | None = None) -> Grouping:
    """Return one group for each category.

    A texture's category comes from `labels` (by index), else from the scene (glTF extras or folder name), else from words of its name.
    The parameters count the textures of each source.
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


def _rows(path: Path) -> list[tuple[str, str]]:
    """Return (texture, category) of each line of a CSV file. Raises InputError."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(
                f"{path}: larger than {LARGEST_FILE // 2**20} MiB; a label file has a line for each texture"
            )
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not UTF-8 text; save the label file as CSV in UTF-8") from None
    reader = csv.DictReader(io.StringIO(text))
    columns = reader.fieldnames or []
    column = next((name for name in TEXTURE_COLUMNS if name in columns), None)
    if column is None or CATEGORY_COLUMN not in columns:
        raise InputError(f"{path}: the first line must name the columns texture and category")
    rows: list[tuple[str, str]] = []
    try:
        for row in reader:
            name, category = (row[column] or "").strip(), (row[CATEGORY_COLUMN] or "").strip()
            if not name or not category:
                raise InputError(f"{path}: line {reader.line_num}: needs a texture and a category")
            if len(category) > LONGEST_NAME:
                raise InputError(
                    f"{path}: line {reader.line_num}: the category has more than {LONGEST_NAME} letters; shorten it"
                )
            rows.append((name, category))
    except csv.Error as error:
        raise InputError(f"{path}: line {reader.line_num}: {error}") from None
    return rows


def read_labels(path: Path, textures: Sequence[SourceTexture]) -> dict[int, str]:
    """Return categories by index in `textures`, from a CSV file with columns texture (also: name, file) and category.

    A line may give a texture's name, its file name with or without folder and suffix, or its pixel hash.
    Raises InputError for a file that is not such a CSV, or that names unknown textures.
    """
    by_key: dict[str, list[int]] = {}
    for index, texture in enumerate(textures):
        path_name = PurePosixPath(texture.name)
        for key in {texture.name, texture.pixel_hash, path_name.name, path_name.stem}:
            by_key.setdefault(key, []).append(index)
    labels: dict[int, str] = {}
    unknown: list[str] = []
    for name, category in _rows(path):
        file = PurePosixPath(name)
        indices = by_key.get(name) or by_key.get(file.name) or by_key.get(file.stem)
        if indices is None:
            unknown.append(name)
            continue
        labels.update(dict.fromkeys(indices, category))
    if unknown:
        more = f" and {len(unknown) - UNKNOWN_SHOWN} more" if len(unknown) > UNKNOWN_SHOWN else ""
        shown = ", ".join(repr(name) for name in unknown[:UNKNOWN_SHOWN])
        raise InputError(f"{path}: names unknown textures: {shown}{more}; ntc-viewer info lists the names")
    return labels
