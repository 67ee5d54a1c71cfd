"""Record of a check: measured values of maps, textures, views and the pack, as a JSON file."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec

from ntc.codec.maps import MapName
from ntc.errors import InputError
from ntc.io import read_file
from viewer.scene.json_text import convert, parse_json

FORMAT = 1
LARGEST_RECORD = 1 << 28
"""Most bytes of a record that is read."""

MeasureName = Literal[
    "psnr_db",
    "normal_degrees",
    "bits_per_texel",
    "bytes",
    "disk_bytes",
    "gpu_bytes",
    "multiply_adds",
    "divergence",
    "flip",
    "ssimulacra2",
    "jod",
]


@dataclass(frozen=True)
class Measure:
    """Measured quantity, with its unit and its texts."""

    title: str
    unit: str
    """Unit printed behind values; empty for none."""
    about: str
    """Explanation in one sentence."""
    higher_is_better: bool
    digits: int
    worse: float
    """Allowed loss where the budget names none."""
    worse_is_share: bool = False
    """True if `worse` is a share of the accepted value."""

    @property
    def heading(self) -> str:
        """Heading of a table column."""
        return f"{self.title} {self.unit}".strip()

    def text(self, value: float) -> str:
        """Return a value as it is printed, with its unit."""
        return f"{value:,.{self.digits}f} {self.unit}".strip()

    def violates(self, value: float, limit: float) -> bool:
        """Return True where `value` lies on the wrong side of `limit`."""
        return value < limit if self.higher_is_better else value > limit

    def loss(self, value: float, accepted: float) -> float:
        """Return the loss of `value` against the accepted one, in the unit of `worse`; negative where it is better."""
        loss = accepted - value if self.higher_is_better else value - accepted
        return loss / max(abs(accepted), 1e-12) if self.worse_is_share else loss


MEASURES: Mapping[MeasureName, Measure] = {
    "psnr_db": Measure(
        "PSNR", "dB", "PSNR over 8-bit values of mip 0, or of a picture's covered pixels.", True, 2, 0.1
    ),
    "normal_degrees": Measure(
        "angle of normals", "degrees", "Mean angle between decoded and original normals.", False, 2, 0.1
    ),
    "bits_per_texel": Measure(
        "bits per texel", "", "Stored bits per texel of mip 0, mips included.", False, 3, 0.005, True
    ),
    "bytes": Measure("size", "bytes", "Stored bytes of a texture, mips included.", False, 0, 0.005, True),
    "disk_bytes": Measure("size on disk", "bytes", "Bytes of the files of the packs.", False, 0, 0.005, True),
    "gpu_bytes": Measure("size on the GPU", "bytes", "Bytes that the packs take on the GPU.", False, 0, 0.005, True),
    "multiply_adds": Measure("multiply-adds", "", "Multiply-adds of one decoded texel at most.", False, 0, 0.005, True),
    "divergence": Measure("divergence", "", "Mean of decoders beyond the first over all 8x8 blocks.", False, 3, 0.02),
    "flip": Measure("FLIP", "", "Mean LDR-FLIP of a picture, 0 to 1.", False, 4, 0.002),
    "ssimulacra2": Measure("SSIMULACRA2", "", "SSIMULACRA2 of a picture; 100 for equal pictures.", True, 1, 0.5),
    "jod": Measure(
        "JOD", "", "ColorVideoVDP of a picture in just-objectionable differences; 10 for equal pictures.", True, 2, 0.05
    ),
}


class MapRecord(msgspec.Struct, frozen=True, omit_defaults=True):
    """Quality of one map of a texture."""

    psnr_db: float | None = None
    """PSNR of mip 0 in dB; None where it is exact."""
    normal_degrees: float | None = None


class TextureRecord(msgspec.Struct, frozen=True, omit_defaults=True):
    """Measured values of one texture."""

    name: str
    content: str
    """Identity of the original and of all data that it is decoded from: equal identities mean equal measured values."""
    pixel_hash: str
    width: int
    height: int
    bytes: int
    bits_per_texel: float
    maps: dict[MapName, MapRecord]
    materials: tuple[str, ...] = ()
    """Names of the materials that use the texture."""
    pack: str = ""
    """File of the pack that holds the texture."""


class ViewRecord(msgspec.Struct, frozen=True, omit_defaults=True):
    """Measured values of a lit picture of the pack, compared with the picture of the original images."""

    camera: str
    light: str
    content: str
    """Identity of the content, camera and light of the picture: equal identities mean equal measured values."""
    psnr_db: float | None = None
    """PSNR in dB of the covered pixels; None where the pictures are equal."""
    flip: float | None = None
    divergence: float | None = None
    ssimulacra2: float | None = None
    jod: float | None = None


class PackRecord(msgspec.Struct, frozen=True, omit_defaults=True):
    """Measured values of all packs together."""

    disk_bytes: int
    bits_per_texel: float
    multiply_adds: int
    gpu_bytes: int | None = None
    """Bytes on the GPU; None where no picture was drawn."""


class PastRecord(msgspec.Struct, frozen=True):
    """Figures of an earlier check, for the trend."""

    date: str
    worst_psnr_db: float | None
    median_psnr_db: float | None
    disk_bytes: int


class Record(msgspec.Struct, frozen=True):
    """All measured values of a check."""

    format: int
    date: str
    """Date and time in UTC, ISO 8601."""
    source: str
    """Scene, pack or library that was checked."""
    pack: PackRecord
    textures: tuple[TextureRecord, ...]
    views: tuple[ViewRecord, ...] = ()
    past: tuple[PastRecord, ...] = ()
    """Earlier checks, oldest first."""


@dataclass(frozen=True)
class Subject:
    """Map, texture, view or pack that has measured values."""

    kind: Literal["map", "texture", "view", "pack"]
    name: str
    """Name of the texture, or of the camera and light."""
    number: int = 0
    """Number among subjects of the same kind and name, from 0."""
    map: MapName | None = None
    materials: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """Name of the subject in messages."""
        name = {"map": f"{self.name}, map {self.map}", "view": f"view {self.name}", "pack": "all packs"}.get(
            self.kind, self.name
        )
        return name + (f" (number {self.number + 1} of that name)" if self.number else "")


Values = Mapping[MeasureName, float]


def measured(record: Record) -> Iterator[tuple[Subject, Values]]:
    """Yield every subject of `record` with its values; exact maps have no PSNR."""
    counts: dict[str, int] = {}
    for texture in record.textures:
        number = counts.get(texture.name, 0)
        counts[texture.name] = number + 1
        whole = Subject("texture", texture.name, number, materials=texture.materials)
        yield whole, {"bits_per_texel": texture.bits_per_texel, "bytes": float(texture.bytes)}
        for name, map_record in texture.maps.items():
            subject = Subject("map", texture.name, number, name, texture.materials)
            yield subject, _known(map_record, ("psnr_db", "normal_degrees"))
    for view in record.views:
        values = _known(view, ("psnr_db", "flip", "divergence", "ssimulacra2", "jod"))
        yield Subject("view", f"{view.camera}, {view.light}"), values
    yield (
        Subject("pack", record.source),
        _known(record.pack, ("disk_bytes", "bits_per_texel", "multiply_adds", "gpu_bytes")),
    )


def _known(record: msgspec.Struct, names: tuple[MeasureName, ...]) -> Values:
    return {name: float(value) for name in names if (value := getattr(record, name)) is not None}


def read_record(path: Path) -> Record:
    """Return the record in the JSON file at `path`. Raises InputError for a file that is not one."""
    remedy = "name the report.json that ntc-viewer check has written"
    try:
        data = read_file(path, LARGEST_RECORD)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); {remedy}") from error
    content: Any = parse_json(data, str(path), remedy)
    record = convert(content, Record, str(path), remedy)
    if record.format != FORMAT:
        raise InputError(f"{path}: has format {record.format}, this version reads {FORMAT}; {remedy}")
    return record
