"""Report of encoding many textures, as lines for the terminal."""

import statistics
from collections import defaultdict
from collections.abc import Sequence

from viewer.encoding.whole_run import RunResult, Stored
from viewer.scene.json_text import counted

MOST_CATEGORIES = 24
"""Most categories in the table; the others share one row."""
NO_CATEGORY = "(none)"


def by_category(stored: Sequence[Stored]) -> dict[str, list[Stored]]:
    """Return the textures of each category, the largest category first; those beyond MOST_CATEGORIES are joined in `others`."""
    categories: dict[str, list[Stored]] = defaultdict(list)
    for each in stored:
        categories[each.ref.category or NO_CATEGORY].append(each)
    ordered = sorted(categories.items(), key=lambda item: (-len(item[1]), item[0]))
    rest = [each for _, textures in ordered[MOST_CATEGORIES:] for each in textures]
    return {**dict(ordered[:MOST_CATEGORIES]), **({"others": rest} if rest else {})}


def _decibels(value: float | None) -> str:
    return "exact" if value is None else f"{value:.2f}"


def _row(name: str, stored: Sequence[Stored]) -> str:
    """Return a row of the table: count, median and worst PSNR, and bits. Exact textures have no PSNR."""
    textures = [each.texture for each in stored]
    finite = [each.psnr_db for each in textures if each.psnr_db is not None]
    texels = [each.width * each.height for each in textures]
    bits = sum(each.bits_per_texel * count for each, count in zip(textures, texels, strict=True)) / max(sum(texels), 1)
    median, worst = (_decibels(of(finite) if finite else None) for of in (statistics.median, min))
    return f"{name[:32]:32} {len(stored):>8} {median:>9} {worst:>8} {bits:>10.2f}"


def report_lines(result: RunResult) -> list[str]:
    """Return the table of categories, the totals, and the failures."""
    lines = [f"{'category':32} {'textures':>8} {'median dB':>9} {'worst dB':>8} {'bits/texel':>10}"]
    lines += [_row(name, stored) for name, stored in {**by_category(result.stored), "all": result.stored}.items()]
    rate = result.texels / max(result.seconds, 1e-9) / 1e6
    others = [
        f", {count} {what}"
        for count, what in (
            (len(result.stored) - result.encoded, "already stored"),
            (result.repeated, "with the pixels of another"),
            (result.constant, "of one colour"),
            (len(result.failed), "failed"),
            (result.tried_again, "job retries" if result.tried_again > 1 else "job retry"),
        )
        if count
    ]
    asked = counted(result.asked, "texture")
    lines.append(f"{asked}: {result.encoded} encoded in {result.seconds:.1f} s ({rate:.2f} Mtexel/s){''.join(others)}")
    return [*lines, *(f"failed: {problem}" for problem in result.failed.values())]
