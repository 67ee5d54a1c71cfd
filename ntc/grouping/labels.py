"""Categories of textures from a CSV file, for the grouping `category`."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from ntc.codec.textures import SourceTexture
from ntc.errors import InputError

TEXTURE_COLUMNS = ("texture", "name", "file")
CATEGORY_COLUMN = "category"
LARGEST_FILE = 16 * 2**20
"""Bytes."""
LONGEST_NAME = 200
UNKNOWN_SHOWN = 3


def _rows(path: Path) -> list[tuple[str, str]]:
    """(texture, category) of each line."""
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
                raise InputError(f"{path}: line {reader.line_num}: a category of more than {LONGEST_NAME} letters")
            rows.append((name, category))
    except csv.Error as error:
        raise InputError(f"{path}: line {reader.line_num}: {error}") from None
    return rows


def read_labels(path: Path, textures: Sequence[SourceTexture]) -> dict[int, str]:
    """Category by index in `textures`, from a CSV with the columns texture (also: name, file) and category.

    A texture is named by its name, by its file's name with or without folder and ending, or by its pixel hash.
    Raises InputError for a file that is no such CSV, or that names textures which are not there.
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
        found = by_key.get(name) or by_key.get(file.name) or by_key.get(file.stem)
        if found is None:
            unknown.append(name)
            continue
        labels.update(dict.fromkeys(found, category))
    if unknown:
        more = f" and {len(unknown) - UNKNOWN_SHOWN} more" if len(unknown) > UNKNOWN_SHOWN else ""
        shown = ", ".join(repr(name) for name in unknown[:UNKNOWN_SHOWN])
        raise InputError(f"{path}: names textures that are not there: {shown}{more}; ntc-viewer info lists the names")
    return labels
