"""Report of a check as one HTML file: findings, a sortable table of all textures, pictures, rate curves, and the trend."""

import base64
import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from viewer.checking.findings import Finding, failures
from viewer.checking.record import MEASURES, PastRecord, Record, TextureRecord
from viewer.scene.json_text import counted
from viewer.training.rates import RateCurve

MOST_STRIPS = 500
"""Most textures with pictures: those with findings, then the worst. More would make the file slow to open."""
CURVE_SIZE = (260, 120)
"""(width, height) of a plotted curve in CSS pixels."""
LABEL_HEIGHT = 10
STYLE = """
:root{color-scheme:light dark;--line:#8884;--bad:#c0392b;--ok:#1e8449}
body{font:15px/1.5 system-ui,sans-serif;margin:1.5rem auto;max-width:78rem;padding:0 1rem}
h1{font-size:1.5rem;margin:0}h2{font-size:1.15rem;margin:2rem 0 .5rem}p{margin:.3rem 0}
.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums;width:100%}
td,th{padding:.2rem .6rem;border-bottom:1px solid var(--line);text-align:right;white-space:nowrap}
td:first-child,th:first-child,td.text,th.text{text-align:left;white-space:normal;overflow-wrap:anywhere;min-width:9rem}
th{cursor:pointer;position:sticky;top:0;background:Canvas}th[aria-sort=ascending]::after{content:" ▲"}
th[aria-sort=descending]::after{content:" ▼"}tr.bad td:first-child{border-left:4px solid var(--bad)}
tbody tr{content-visibility:auto;contain-intrinsic-size:auto 2.2rem}
img{image-rendering:auto;display:block;height:48px;width:144px}
.bad-text{color:var(--bad)}.ok-text{color:var(--ok)}li{margin:.15rem 0;overflow-wrap:anywhere}
input{font:inherit;padding:.2rem .5rem;width:min(24rem,100%)}figure{display:inline-block;margin:.4rem 1.2rem .4rem 0}
figcaption{font-size:13px;max-width:17rem;overflow-wrap:anywhere}svg{background:#8881}
""".strip()
SCRIPT = """
const table=document.querySelector("#textures"),body=table&&table.tBodies[0];
if(table){const value=(row,i)=>row.cells[i].dataset.value??row.cells[i].textContent;
table.tHead.rows[0].querySelectorAll("th").forEach((head,i)=>head.addEventListener("click",()=>{
const down=head.getAttribute("aria-sort")==="ascending";
table.querySelectorAll("th").forEach(each=>each.removeAttribute("aria-sort"));
head.setAttribute("aria-sort",down?"descending":"ascending");
const rows=[...body.rows],number=rows.every(row=>value(row,i)===""||!isNaN(value(row,i)));
rows.sort((a,b)=>{const x=value(a,i),y=value(b,i);
if(x===""||y==="")return(x==="")-(y==="");
const order=number?x-y:x.localeCompare(y);return down?-order:order});
body.append(...rows)}));
const field=document.querySelector("#filter");
field.addEventListener("input",()=>{const words=field.value.toLowerCase().split(/\\s+/);
for(const row of body.rows){const text=row.textContent.toLowerCase();row.hidden=!words.every(word=>text.includes(word))}})}
""".strip()


@dataclass(frozen=True, eq=False)
class PageContent:
    """Content of the page."""

    record: Record
    findings: tuple[Finding, ...]
    strips: Mapping[str, bytes] = field(default_factory=dict)
    """JPEG of original, decoded and difference, by content of the texture."""
    curves: Mapping[str, RateCurve] = field(default_factory=dict)
    """Rate curves by content of the texture."""


def page(content: PageContent) -> str:
    """Return the report as HTML that needs no other file and no network."""
    record, failing = content.record, failures(content.findings)
    verdict = (
        f"<p class=bad-text>{counted(len(failing), 'finding')} outside the budget</p>"
        if failing
        else "<p class=ok-text>All values are within the budget</p>"
    )
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content='width=device-width'>",
        f"<title>Check of {_text(record.source)}</title><style>{STYLE}</style>",
        f"<h1>Check of {_text(record.source)}</h1><p>{_text(record.date)}, {counted(len(record.textures), 'texture')}, "
        f"{record.pack.disk_bytes:,} bytes on disk, {record.pack.bits_per_texel:.2f} bits per texel</p>{verdict}",
        _findings(content),
        _curves(content),
        _views(record),
        _textures(content),
        _trend((*record.past, past_of(record))),
        f"<script>{SCRIPT}</script></html>",
    ]
    return "\n".join(part for part in parts if part) + "\n"


def past_of(record: Record) -> PastRecord:
    """Return the figures of `record` for the trend of later checks."""
    values = sorted(
        map_record.psnr_db
        for texture in record.textures
        for map_record in texture.maps.values()
        if map_record.psnr_db is not None
    )
    median = values[len(values) // 2] if values else None
    return PastRecord(record.date, values[0] if values else None, median, record.pack.disk_bytes)


def _text(text: str) -> str:
    return html.escape(text.encode("utf-8", "replace").decode(), quote=True)


def _findings(content: PageContent) -> str:
    if not content.findings:
        return ""
    lines = [
        f"<li{'' if each.is_waived else ' class=bad-text'}>{_text(each.text)}{_remedy(content, each)}</li>"
        for each in content.findings
    ]
    return f"<h2>Findings, worst first</h2><ul>{''.join(lines)}</ul>"


def _texture_of(content: PageContent, finding: Finding) -> TextureRecord | None:
    named = [texture for texture in content.record.textures if texture.name == finding.subject.name]
    return named[finding.subject.number] if finding.subject.number < len(named) else None


def _remedy(content: PageContent, finding: Finding) -> str:
    """Return a text of the bits that a finding about PSNR needs, where the rate curve is known; else ""."""
    texture = _texture_of(content, finding)
    curve = content.curves.get(texture.content) if texture is not None else None
    if curve is None or finding.measure != "psnr_db" or finding.subject.map is None:
        return ""
    least, most = curve.points[0].bits, curve.points[-1].bits
    bits = max(curve.of_map(finding.subject.map).bits_at(finding.bound), least)
    return f"; needs {f'about {bits:.1f}' if bits <= most else f'more than {most:.1f}'} bits per texel"


def _curves(content: PageContent) -> str:
    figures = [
        f"<figure>{_plot(curve)}<figcaption>{_text(texture.name)}: PSNR over bits per texel, each map; encoded alone"
        "</figcaption></figure>"
        for texture in content.record.textures
        if (curve := content.curves.get(texture.content)) is not None
    ]
    return f"<h2>Bits that would mend it</h2>{''.join(figures)}" if figures else ""


def _plot(curve: RateCurve) -> str:
    width, height = CURVE_SIZE
    values = [psnr_db for point in curve.points for psnr_db in point.by_map.values()]
    low, high = min(values) - 1.0, max(values) + 1.0
    most = curve.points[-1].bits
    lines, labels = [], list[float]()
    for number, name in enumerate(curve.points[0].by_map):
        known = [(point.bits, point.by_map[name]) for point in curve.points]
        at = [(10 + x / most * (width - 70), height - 18 - (y - low) / (high - low) * (height - 30)) for x, y in known]
        color = f"hsl({number * 67 % 360} 70% 50%)"
        lines.append(f"<polyline fill=none stroke='{color}' points='{' '.join(f'{x:.1f},{y:.1f}' for x, y in at)}'/>")
        down = at[-1][1] + 4
        while any(abs(down - other) < LABEL_HEIGHT for other in labels):
            down += 1
        labels.append(down)
        lines.append(f"<text x={at[-1][0] + 3:.1f} y={down:.1f} font-size=10 fill='{color}'>{_text(name)}</text>")
    axis = "".join(
        f"<text x={10 + point.bits / most * (width - 70):.1f} y={height - 4} font-size=10 fill=gray "
        f"text-anchor=middle>{point.bits:.1f}</text>"
        for point in curve.points
    )
    top = f"<text x=4 y=11 font-size=10 fill=gray>{high - 1:.0f} dB</text>"
    return f"<svg width={width} height={height} role=img>{''.join(lines)}{axis}{top}</svg>"


def _cell(value: float | None, digits: int) -> str:
    return "<td data-value=''>-</td>" if value is None else f"<td data-value={value!r}>{value:,.{digits}f}</td>"


def _views(record: Record) -> str:
    if not record.views:
        return ""
    rows = [
        f"<tr><td>{_text(view.camera)}</td><td class=text>{_text(view.light)}</td>{_cell(view.psnr_db, 2)}{_cell(view.flip, 4)}"
        f"{_cell(view.ssimulacra2, 1)}{_cell(view.jod, 2)}{_cell(view.divergence, 3)}</tr>"
        for view in record.views
    ]
    heads = "".join(
        f"<th title='{_text(MEASURES[name].about)}'>{_text(MEASURES[name].heading)}</th>"
        for name in ("psnr_db", "flip", "ssimulacra2", "jod", "divergence")
    )
    head = f"<tr><th>camera</th><th class=text>light</th>{heads}</tr>"
    return f"<h2>Lit views</h2><div class=wide><table><thead>{head}</thead><tbody>{''.join(rows)}</tbody></table></div>"


def _textures(content: PageContent) -> str:
    failing = {(each.subject.name, each.subject.map) for each in failures(content.findings)}
    failing |= {(name, None) for name, _ in failing}
    rows = []
    order = sorted(content.record.textures, key=lambda each: ((each.name, None) not in failing, _worst(each)))
    pictured = {texture.content for texture in order[:MOST_STRIPS]}
    for texture in order:
        for name, map_record in texture.maps.items():
            strip = content.strips.get(texture.content) if texture.content in pictured else None
            picture = (
                f"<img loading=lazy alt='original, decoded, difference' src=data:image/jpeg;base64,{base64.b64encode(strip).decode()}>"
                if strip is not None and name == next(iter(texture.maps))
                else ""
            )
            bad = (
                " class=bad"
                if {(texture.name, name), (texture.name, None)} & failing and (texture.name, name) in failing
                else ""
            )
            rows.append(
                f"<tr{bad}><td>{_text(texture.name)}</td><td class=text>{_text(', '.join(texture.materials))}</td>"
                f"<td class=text>{name}</td>{_cell(map_record.psnr_db, 2)}{_cell(map_record.normal_degrees, 2)}"
                f"{_cell(texture.bits_per_texel, 2)}{_cell(float(texture.bytes), 0)}"
                f"<td data-value={texture.width * texture.height}>{texture.width} x {texture.height}</td><td>{picture}</td></tr>"
            )
    names = (
        "texture",
        "materials",
        "map",
        "PSNR dB",
        "normals °",
        "bits/texel",
        "bytes",
        "size",
        "original, decoded, difference x8",
    )
    heads = "".join(f"<th{' class=text' if number in (1, 2) else ''}>{name}</th>" for number, name in enumerate(names))
    return (
        "<h2>Textures</h2><p><input id=filter type=search placeholder='Filter by texture, material or map' aria-label=Filter></p>"
        f"<div class=wide><table id=textures><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
    )


def _worst(texture: TextureRecord) -> float:
    return min(
        (map_record.psnr_db for map_record in texture.maps.values() if map_record.psnr_db is not None), default=1e9
    )


def _trend(past: Sequence[PastRecord]) -> str:
    if len(past) < 2:
        return ""
    rows = [
        f"<tr><td>{_text(each.date)}</td>{_cell(each.worst_psnr_db, 2)}{_cell(each.median_psnr_db, 2)}"
        f"{_cell(float(each.disk_bytes), 0)}</tr>"
        for each in reversed(past)
    ]
    head = "<tr><th>date</th><th>worst map, dB</th><th>median map, dB</th><th>bytes on disk</th></tr>"
    return f"<h2>Trend</h2><div class=wide><table><thead>{head}</thead><tbody>{''.join(rows)}</tbody></table></div>"
