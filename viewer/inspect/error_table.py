"""Rows of the panel Errors: textures or decoders by the difference between A and B."""

from viewer.inspect.comparison import Comparison, ErrorRow
from viewer.state.session import ErrorColumn, Session


def _value(name: str, row: ErrorRow, column: ErrorColumn) -> float | str:
    values: dict[ErrorColumn, float | str] = {
        "name": name.lower(),
        "decoder": row.decoder,
        "pixels": row.pixels,
        "psnr": row.psnr_db,
        "mean": row.mean,
        "max": row.largest,
    }
    return values[column]


def sorted_rows(session: Session, comparison: Comparison | None) -> list[tuple[str, ErrorRow]]:
    """Return the rows of a comparison with their names, in the order of the panel Errors; none without a comparison."""
    table = session.inspection.errors
    if comparison is None:
        return []
    if table.by == "texture":
        textures = session.scene.textures
        rows = [(textures[row.number].name, row) for row in comparison.textures if row.number < len(textures)]
    else:
        rows = [(f"decoder {row.number}", row) for row in comparison.decoders]
    # Python's sort is stable: equal rows stay in order of their numbers.
    return sorted(rows, key=lambda named: _value(named[0], named[1], table.column), reverse=table.descending)
