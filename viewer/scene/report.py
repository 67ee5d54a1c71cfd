"""Load report of a scene: gathered while it is read, shown by `ntc-viewer info SCENE` and the window."""

from collections import Counter
from dataclasses import asdict
from typing import Any

from ntc.codec.maps import BASE_ALONE, PLANES
from viewer.scene.json_text import counted
from viewer.scene.model import LoadReport, Material, Scene

ONE = {"meshes": "mesh", "triangles drawn": "triangle drawn", "vertices": "vertex"}
"""Singular of the counts whose plural has more than an s."""
KINDS = ("honoured", "ignored", "missing", "repaired", "notes")
"""Lists of the report, in the order in which they are shown."""
MAX_LINES = 200
"""Most distinct lines of one kind in a report; the rest is counted."""


class ReportNotes:
    """Remarks of one load, with equal ones counted."""

    def __init__(self) -> None:
        self._lines: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}

    def honoured(self, what: str, count: int = 1) -> None:
        """Count a feature that is drawn as specified, `count` times more."""
        self._add("honoured", what, count)

    def ignored(self, what: str, count: int = 1) -> None:
        """Count a feature that has no effect here."""
        self._add("ignored", what, count)

    def missing(self, what: str) -> None:
        """Count something that could not be read; `what` also names what is used instead."""
        self._add("missing", what, 1)

    def repaired(self, what: str) -> None:
        """Count broken values of the file; `what` also names what is used instead."""
        self._add("repaired", what, 1)

    def note(self, what: str, count: int = 1) -> None:
        """Count any other remark."""
        self._add("notes", what, count)

    def _add(self, kind: str, what: str, count: int) -> None:
        if count > 0:
            self._lines[kind][what] += count

    def _finished(self, kind: str) -> tuple[str, ...]:
        lines = [text if count == 1 else f"{text} ({count})" for text, count in self._lines[kind].items()]
        if len(lines) > MAX_LINES:
            return (*lines[:MAX_LINES], f"and {len(lines) - MAX_LINES} more")
        return tuple(lines)

    def report(self, used: dict[str, int]) -> LoadReport:
        """Return the finished report with the counts `used`."""
        return LoadReport(used=used, **{kind: self._finished(kind) for kind in KINDS})


def _texture_line(index: int, scene: Scene) -> str:
    texture = scene.textures[index]
    width, height = texture.size
    users = sum(any(material.plane_texture(plane) == index for plane in PLANES) for material in scene.materials)
    extras = [counted(users, "material")]
    if texture.maps != BASE_ALONE:
        extras.append(" + ".join(texture.maps))
    if texture.has_alpha:
        extras.append("alpha")
    if texture.category is not None:
        extras.append(texture.category)
    return f"  {index:3d}  {width} x {height}  {texture.name}  ({', '.join(extras)})"


def report_lines(scene: Scene) -> list[str]:
    """Return the load report as lines of text: counts, what is honoured, ignored, missing and repaired, cameras, textures."""
    report = scene.report
    low, high = (", ".join(f"{value:.3g}" for value in corner) for corner in scene.bounds)
    lines = [
        f"{scene.path or scene.name}: " + ", ".join(_counted(count, what) for what, count in report.used.items()),
        f"bounds: {low} to {high}",
    ]
    for kind in KINDS:
        if entries := getattr(report, kind):
            lines.append(f"{kind}:")
            lines.extend(f"  {entry}" for entry in entries)
    if scene.cameras:
        lines.append("cameras: " + ", ".join(camera.name for camera in scene.cameras))
    if scene.textures:
        lines.append("textures:")
        lines.extend(_texture_line(index, scene) for index in range(len(scene.textures)))
    return lines


def _counted(count: int, plural: str) -> str:
    """Return a count of the report with its noun: `1 mesh`, `2 meshes`."""
    if count != 1:
        return f"{count} {plural}"
    return f"1 {ONE.get(plural, plural.removesuffix('s'))}"


def _material_json(material: Material) -> dict[str, Any]:
    planes = {
        plane: material.surface if plane == "surface" else material.emission for plane in PLANES if plane != "base"
    }
    return {
        "name": material.name,
        "texture_id": material.texture_id,
        "factor": list(material.factor),
        "planes": {plane: asdict(texture) for plane, texture in planes.items() if texture is not None},
        "factors": asdict(material.factors),
    }


def report_json(scene: Scene) -> dict[str, Any]:
    """Return the load report as JSON values."""
    report = scene.report
    return {
        "file": None if scene.path is None else str(scene.path),
        "name": scene.name,
        "used": dict(report.used),
        "bounds": [[float(value) for value in corner] for corner in scene.bounds],
        **{kind: list(getattr(report, kind)) for kind in KINDS},
        "cameras": [camera.name for camera in scene.cameras],
        "materials": [_material_json(material) for material in scene.materials],
        "lights": [asdict(light) for light in scene.lights],
        "textures": [
            {
                "name": texture.name,
                "width": texture.size[0],
                "height": texture.size[1],
                "alpha": texture.has_alpha,
                "maps": list(texture.maps),
                "pixel_hash": texture.pixel_hash,
                "set_hash": texture.set_hash or texture.pixel_hash,
                "category": texture.category,
                "origin": texture.origin,
            }
            for texture in scene.textures
        ],
    }
