"""`ntc-viewer study materials`: maps of materials together, each alone, and in the formats of graphics hardware."""

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from lab.commands.options import MaterialStudyOptions
from lab.runner import StudyOutput
from lab.studies.materials.coding import MaterialPoint
from lab.studies.materials.hardware import astc_parts, bc_coding, best_astc
from lab.studies.materials.own_codec import alone, together
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from viewer.cli.encode import read_source
from viewer.cli.table import Cell, Column, Table

TOGETHER, SEEN, ALONE, ASTC, BC = "together, equal", "together, seen", "each alone", "ASTC", "BC7, BC5"
COLUMNS = (
    Column("curve", "codec"),
    Column("setting", "setting"),
    Column("bits_per_texel", "bits/texel in all", 3),
    Column("mean_db", "all channels dB"),
    Column("base_db", "base dB"),
    Column("normal_db", "normal dB"),
    Column("linear_db", "roughness, metalness, occlusion dB"),
    Column("emissive_db", "emissive dB"),
    Column("degrees", "normals, mean degrees"),
    Column("degrees_95", "95 % below"),
)


def _materials(options: MaterialStudyOptions) -> tuple[SourceTexture, ...]:
    """Distinct material sets with normals and one more map. Raises InputError where there are none."""
    found: dict[str, SourceTexture] = {}
    for source in options.sources:
        for texture in read_source(source, options.texture_size, "all").textures:
            if "normal" in texture.maps and len(texture.maps) > 1:
                found.setdefault(texture.pixel_hash, texture)
    textures = list(found.values())
    if not textures:
        raise InputError("study materials: no material has normals and one more map; name scenes whose materials do")
    if len(textures) > options.most:
        textures = [textures[index * len(textures) // options.most] for index in range(options.most)]
    return tuple(textures)


def at_bits(points: Sequence[MaterialPoint], curve: str, field: str, bits: float) -> float | None:
    """`field` of a curve at `bits`, linear in their logarithm between its points; None beyond them."""
    own = sorted((point.bits_per_texel, getattr(point, field)) for point in points if point.curve == curve)
    if not own or not own[0][0] * 0.99 <= bits <= own[-1][0] * 1.01 or any(value is None for _, value in own):
        return None
    return float(np.interp(np.log2(bits), np.log2([each for each, _ in own]), [value for _, value in own]))


def bits_to_reach(points: Sequence[MaterialPoint], curve: str, mean_db: float) -> float | None:
    """Bits at which a curve comes to `mean_db`, by `at_bits`; None where it does not, or begins above."""
    own = sorted((point.mean_db, point.bits_per_texel) for point in points if point.curve == curve)
    if not own or not own[0][0] <= mean_db <= own[-1][0]:
        return None
    return float(2.0 ** np.interp(mean_db, [each for each, _ in own], np.log2([bits for _, bits in own])))


def comparisons(points: Sequence[MaterialPoint]) -> list[dict[str, Cell]]:
    """At the bits of each point of the others: what maps together have more, and the angle of normals over theirs."""
    rows: list[dict[str, Cell]] = []
    for point in points:
        if point.curve not in (ALONE, ASTC):
            continue
        for own in (TOGETHER, SEEN):
            mean = at_bits(points, own, "mean_db", point.bits_per_texel)
            degrees = at_bits(points, own, "degrees", point.bits_per_texel)
            if mean is not None and degrees is not None and point.degrees:
                row: dict[str, Cell] = {"curve": own, "beside": point.curve, "bits_per_texel": point.bits_per_texel}
                rows.append({**row, "more_db": mean - point.mean_db, "angle_ratio": degrees / point.degrees})
    return rows


def _points(
    textures: tuple[SourceTexture, ...], options: MaterialStudyOptions, console: Console
) -> list[MaterialPoint]:
    points: list[MaterialPoint] = []

    def add(point: MaterialPoint) -> None:
        points.append(point)
        degrees = "" if point.degrees is None else f", {point.degrees:.2f} degrees"
        line = f"{point.curve}, {point.setting}: {point.bits_per_texel:.2f} bits, {point.mean_db:.2f} dB{degrees}"
        console.print(line, highlight=False)

    def report(line: str) -> None:
        console.print(f"  {line}", highlight=False)

    for bits in options.bits:
        setting = f"{bits:g} bits"
        add(MaterialPoint.of(TOGETHER, setting, together(textures, bits, "equal"), textures))
        add(MaterialPoint.of(SEEN, setting, together(textures, bits, "seen"), textures))
        add(MaterialPoint.of(ALONE, setting, alone(textures, bits, report), textures))
    try:
        add(MaterialPoint.of(BC, "8 bits each", bc_coding(textures), textures))
        parts = astc_parts(textures, report)
        for bits in options.bits:
            best = best_astc(parts, textures, bits)
            if best is not None:
                add(MaterialPoint.of(ASTC, best[0], best[1], textures))
    except InputError as error:
        console.print(f"left out: {error}", highlight=False)
    return points


def material_figure(points: Sequence[MaterialPoint]) -> Figure:
    """PSNR over all channels, and angle of normals, over bits."""
    figure = Figure(figsize=(12, 4.8), layout="constrained")
    pairs = (("mean_db", "PSNR over all channels, dB"), ("degrees", "mean angle of normals, degrees"))
    for axes, (field, label) in zip(figure.subplots(1, 2), pairs, strict=True):
        for curve in dict.fromkeys(point.curve for point in points):
            own = [(p.bits_per_texel, getattr(p, field)) for p in points if p.curve == curve]
            known = sorted((bits, value) for bits, value in own if value is not None)
            if known:
                style = "--" if curve in (ASTC, BC) else "-"
                axes.plot(*zip(*known, strict=True), style, marker="o", markersize=4, label=curve)
        axes.set_xlabel("bits per texel of all maps, all mips and tables")
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    return figure


def study_materials(options: MaterialStudyOptions) -> int:
    """Run `ntc-viewer study materials`. Raises InputError for bad input."""
    output = StudyOutput(options.out)
    if not options.bits or not all(bits > 0.0 for bits in options.bits):
        raise InputError("--bits: name numbers above 0")
    if options.texture_size < 1 or options.most < 1:
        raise InputError("--texture-size and --most: must be at least 1")
    textures = _materials(options)
    points = _points(textures, options, Console(stderr=True, soft_wrap=True))
    rows: list[dict[str, Cell]] = [asdict(point) for point in points]
    table = Table([c for c in COLUMNS if any(row.get(c.key) is not None for row in rows)], rows)
    bc = next((point.mean_db for point in points if point.curve == BC), None)
    reached = None if bc is None else bits_to_reach(points, TOGETHER, bc)
    title = f"{len(textures)} materials of at most {max(max(each.size) for each in textures)} texels"
    facts = {
        "materials": [{"name": each.name, "maps": list(each.maps), "size": list(each.size)} for each in textures],
        "comparisons": comparisons(points),
        "bits_at_the_quality_of_bc": reached,
    }
    summary = table.text()
    if reached is not None:
        summary += f"the quality of BC7 and BC5 (24 bits) is reached at {reached:.2f} bits\n"
    output.write("materials", title, table, material_figure(points), facts, rows, summary)
    output.end()
    return 0
