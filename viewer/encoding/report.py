"""The report of encoding many textures: lines for the terminal, and a folder with a page (HTML), the figures (JSON) and pictures."""

import html
import io
import statistics
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ntc.api import decode
from ntc.errors import InputError
from ntc.features.pixels import as_rgb
from ntc.io import atomic_folder, write_bytes, write_text
from ntc.library.index import shard_path
from ntc.pack.file import read_textures
from viewer.encoding.whole_run import RunResult, Stored
from viewer.encoding.work import Reading, read_texture
from viewer.scene.images import write_png
from viewer.scene.json_text import counted

REPORT_FILE = "report.json"
WORST_SHOWN = 12
THUMBNAIL = 192
"""Texels a side that are shown of a texture: cut from its middle."""
MOST_CATEGORIES = 24
"""Largest number of categories in the plot; the others come together."""
NAMED_ON_SCREEN = 10
NO_CATEGORY = "(none)"
LARGEST_SHOWN = 4096 * 4096
"""Texels: larger textures are not read again for a picture."""


def _psnr(stored: Stored) -> float:
    return float("inf") if stored.texture.psnr_db is None else stored.texture.psnr_db


def _figures(stored: Sequence[Stored]) -> dict[str, Any]:
    """Counts and medians of some textures; an exact one has no PSNR."""
    finite = sorted(each.texture.psnr_db for each in stored if each.texture.psnr_db is not None)
    texels = [each.texture.width * each.texture.height for each in stored]
    bits = [each.texture.bits_per_texel for each in stored]
    mean_bits = sum(b * t for b, t in zip(bits, texels, strict=True)) / max(sum(texels), 1)
    return {
        "textures": len(stored),
        "texels": sum(texels),
        "psnr_db_median": statistics.median(finite) if finite else None,
        "psnr_db_worst": finite[0] if finite else None,
        "bits_per_texel": mean_bits,
    }


def by_category(stored: Sequence[Stored]) -> dict[str, list[Stored]]:
    """Return the textures of each category, the largest first; small ones beyond MOST_CATEGORIES together."""
    found: dict[str, list[Stored]] = defaultdict(list)
    for each in stored:
        found[each.ref.category or NO_CATEGORY].append(each)
    ordered = sorted(found.items(), key=lambda item: (-len(item[1]), item[0]))
    rest = [each for _, own in ordered[MOST_CATEGORIES:] for each in own]
    return {**dict(ordered[:MOST_CATEGORIES]), **({"others": rest} if rest else {})}


def summary(result: RunResult) -> dict[str, Any]:
    """Return the run as JSON values, without its textures."""
    return {
        "asked": result.asked,
        "stored": len(result.stored),
        "encoded_now": result.encoded,
        "repeated": result.repeated,
        "constant": result.constant,
        "failed": result.failed,
        "jobs_tried_again": result.tried_again,
        "seconds": result.seconds,
        "texels_per_second": result.texels / max(result.seconds, 1e-9),
        "all": _figures(result.stored),
        "categories": {name: _figures(own) for name, own in by_category(result.stored).items()},
    }


def _json_row(stored: Stored) -> bytes:
    own = stored.texture
    row = {
        "name": stored.ref.name,
        "path": stored.ref.path,
        "category": stored.ref.category,
        "pixel_hash": own.pixel_hash,
        "width": own.width,
        "height": own.height,
        "bits_per_texel": own.bits_per_texel,
        "psnr_db": own.psnr_db,
        "shard": stored.shard,
    }
    return msgspec.json.encode(row)


def _document(result: RunResult) -> bytes:
    """Return the run and every texture of it as JSON."""
    whole = msgspec.json.format(msgspec.json.encode(summary(result)), indent=1)
    # Row by row: as objects, they would take a multiple of their text.
    return whole.removesuffix(b"\n}") + b',\n "textures": [\n' + b",\n".join(map(_json_row, result.stored)) + b"\n]}\n"


def _decibels(value: float | None) -> str:
    return "exact" if value is None else f"{value:.2f}"


def report_lines(result: RunResult) -> list[str]:
    """Return the table of categories and what failed, for the terminal."""
    lines = [f"{'category':32} {'textures':>8} {'median dB':>9} {'worst dB':>8} {'bits/texel':>10}"]
    rows = {**{name: _figures(own) for name, own in by_category(result.stored).items()}, "all": _figures(result.stored)}
    for name, row in rows.items():
        median, worst = _decibels(row["psnr_db_median"]), _decibels(row["psnr_db_worst"])
        lines.append(f"{name[:32]:32} {row['textures']:>8} {median:>9} {worst:>8} {row['bits_per_texel']:>10.2f}")
    rate = result.texels / max(result.seconds, 1e-9) / 1e6
    others = [
        f"{count} {what}"
        for count, what in (
            (len(result.stored) - result.encoded, "already stored"),
            (result.repeated, "with the pixels of another"),
            (result.constant, "of one colour"),
            (len(result.failed), "failed"),
            (result.tried_again, "job retries" if result.tried_again > 1 else "job retry"),
        )
        if count
    ]
    told = "".join(f", {each}" for each in others)
    lines.append(
        f"{counted(result.asked, 'texture')}: {result.encoded} encoded in {result.seconds:.1f} s ({rate:.2f} Mtexel/s){told}"
    )
    problems = list(result.failed.values())
    lines += [f"failed: {problem}" for problem in problems[:NAMED_ON_SCREEN]]
    if len(problems) > NAMED_ON_SCREEN:
        lines.append(f"failed: {len(problems) - NAMED_ON_SCREEN} more; the report names them")
    return lines


def _plot(result: RunResult) -> bytes:
    """Return the PSNR against bits of every texture by category, and how PSNR is spread in each, as PNG."""
    groups = by_category(result.stored)
    figure = Figure(figsize=(11, max(3.2, 0.34 * len(groups) + 1.2)), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.2, 1))
    for number, own in enumerate(groups.values()):
        finite = [each for each in own if each.texture.psnr_db is not None]
        color = f"C{number % 10}"
        left.scatter(
            [e.texture.bits_per_texel for e in finite], [_psnr(e) for e in finite], s=9, alpha=0.6, color=color
        )
        if finite:
            values = [_psnr(each) for each in finite]
            lines = {f"{part}props": {"color": color} for part in ("box", "whisker", "cap", "median")}
            right.boxplot(values, positions=[-number], orientation="horizontal", widths=0.6, **lines)
    left.set(xlabel="bits per texel, all mips", ylabel="PSNR in dB of mip 0")
    right.set(xlabel="PSNR in dB", yticks=[-number for number in range(len(groups))])
    right.set_yticklabels([f"{name[:24]} ({len(own)})" for name, own in groups.items()])
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=110)
    return data.getvalue()


def _middle(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = pixels.shape[:2]
    y, x = max(0, (height - THUMBNAIL) // 2), max(0, (width - THUMBNAIL) // 2)
    return np.ascontiguousarray(as_rgb(pixels[y : y + THUMBNAIL, x : x + THUMBNAIL]))


def _pictures(stored: Stored, library: Path, reading: Reading) -> tuple[NDArray[np.uint8], NDArray[np.uint8]] | None:
    """Return the middle of a texture, original and decoded; None where it cannot be had any more."""
    try:
        if stored.texture.width * stored.texture.height > LARGEST_SHOWN:
            return None
        source = read_texture(stored.ref, reading)
        pack = read_textures(shard_path(library, stored.shard), {stored.texture.pixel_hash})
    except InputError:
        return None
    return None if source is None else (_middle(source.pixels), _middle(decode(pack, 0)))


def write_report(folder: Path, result: RunResult, library: Path, reading: Reading) -> None:
    """Write `index.html`, `report.json`, `plot.png` and pictures of the worst textures into `folder`; an earlier report is replaced.

    `library` holds the textures, which were read as `reading` says. Raises InputError where the folder cannot be written.
    """
    with atomic_folder(folder, REPORT_FILE) as made:
        write_bytes(made / REPORT_FILE, _document(result))
        worst = list[tuple[Stored, str]]()
        ordered = sorted(result.stored, key=lambda each: (_psnr(each), each.ref.name))
        for number, each in enumerate(ordered[:WORST_SHOWN]):
            pictures = _pictures(each, library, reading)
            if pictures is not None:
                for kind, pixels in zip(("original", "decoded"), pictures, strict=True):
                    write_png(made / f"worst-{number:02}-{kind}.png", pixels)
            worst.append((each, f"worst-{number:02}" if pictures is not None else ""))
        if result.stored:
            write_bytes(made / "plot.png", _plot(result))
        write_text(made / "index.html", _page(result, worst))


def _row(cells: Sequence[str], tag: str = "td") -> str:
    return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"


def _page(result: RunResult, worst: Sequence[tuple[Stored, str]]) -> str:
    head = ("category", "textures", "median dB", "worst dB", "bits per texel")
    rows = {**by_category(result.stored), "all": result.stored}
    table = [_row(head, "th")]
    for name, own in rows.items():
        found = _figures(own)
        cells = (str(found["textures"]), _decibels(found["psnr_db_median"]), _decibels(found["psnr_db_worst"]))
        table.append(_row((name, *cells, f"{found['bits_per_texel']:.2f}")))
    figures = [_figure(each, name) for each, name in worst]
    failed = [_row((path, problem)) for path, problem in sorted(result.failed.items())]
    (told,) = [line for line in report_lines(result) if line.startswith(f"{counted(result.asked, 'texture')}: ")]
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content='width=device-width'>",
        "<title>Encoded textures</title><style>",
        "body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:70rem;padding:0 1rem}",
        "table{border-collapse:collapse}td,th{padding:.2rem .8rem;border-bottom:1px solid #ccc;text-align:right}",
        "td:first-child,th:first-child{text-align:left}figure{display:inline-block;margin:.5rem}img{max-width:100%}",
        "figcaption{font-size:13px;max-width:24rem;overflow-wrap:anywhere}.failed td{text-align:left}</style>",
        f"<h1>Encoded textures</h1><p>{html.escape(told)}</p><table>{''.join(table)}</table>",
        "<h2>PSNR and bits by category</h2><img src=plot.png alt='PSNR and bits by category'>" if result.stored else "",
        f"<h2>Worst textures</h2><p>Original and decoded, the middle of each.</p>{''.join(figures)}" if figures else "",
        f"<h2>Failed</h2><table class=failed>{''.join(failed)}</table>" if failed else "",
        f"<p><a href={REPORT_FILE}>All figures as JSON</a></p></html>",
    ]
    return "\n".join(part for part in parts if part)


def _figure(stored: Stored, picture: str) -> str:
    own = stored.texture
    text = f"{stored.ref.name}: {_decibels(own.psnr_db)} dB, {own.bits_per_texel:.2f} bits, {own.width} x {own.height}"
    images = (
        "".join(f"<img src={picture}-{kind}.png alt={kind}> " for kind in ("original", "decoded")) if picture else ""
    )
    return f"<figure>{images}<figcaption>{html.escape(text)}</figcaption></figure>"
