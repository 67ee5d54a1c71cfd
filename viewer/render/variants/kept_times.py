"""Measured times of decoder variants, kept in the cache folder: a file for each device, driver and codec shape."""

import hashlib
import json
import math
from pathlib import Path
from typing import Any, Final, get_args

from ntc.errors import InputError
from ntc.io import write_text
from viewer.gl.context import ContextInformation
from viewer.render.resources.variant import parsed_variant
from viewer.render.variants.measurement import VariantTimes
from viewer.state.view_state import Precision

LARGEST_FILE: Final = 1 << 16
FORMAT: Final = 1
"""Counted up when times of an older version tell nothing of the shaders any more."""


def _path(folder: Path, device: ContextInformation, shape: str) -> Path:
    key = "\n".join((str(FORMAT), device.vendor, device.renderer, device.version, shape))
    return folder / f"{hashlib.sha256(key.encode()).hexdigest()[:24]}.json"


def read_times(folder: Path, device: ContextInformation, shape: str) -> VariantTimes | None:
    """What `keep_times` wrote for this device and shape; None where there is nothing, or a file that it did not write."""
    try:
        with _path(folder, device, shape).open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
        if len(content) > LARGEST_FILE:
            return None
        found = json.loads(content)
        return VariantTimes(
            {
                _precision(precision): {parsed_variant(text): _time(value) for text, value in own.items()}
                for precision, own in found["nanoseconds"].items()
            }
        )
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError, InputError):
        return None


def _precision(name: str) -> Precision:
    if name not in get_args(Precision):
        raise ValueError(name)
    return name  # type: ignore[return-value]


def _time(value: Any) -> float:
    time = float(value)
    if not 0.0 < time < math.inf:
        raise ValueError(value)
    return time


def keep_times(folder: Path, device: ContextInformation, shape: str, times: VariantTimes) -> None:
    """Write `times`. A folder that cannot be written to is no error: they are measured again."""
    content = {
        "renderer": device.renderer,
        "version": device.version,
        "shape": shape,
        "nanoseconds": {
            precision: {str(variant): time for variant, time in own.items()}
            for precision, own in times.nanoseconds.items()
        },
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_text(_path(folder, device, shape), json.dumps(content, indent=2) + "\n")
    except (OSError, InputError):
        return


def kept_times(folder: Path, device: ContextInformation) -> dict[str, VariantTimes]:
    """All that is kept for a device, by codec shape."""
    found: dict[str, VariantTimes] = {}
    for path in sorted(folder.glob("*.json")):
        try:
            with path.open("rb") as file:
                shape = json.loads(file.read(LARGEST_FILE))["shape"]
        except (OSError, ValueError, TypeError, KeyError, RecursionError):
            continue
        if isinstance(shape, str) and path == _path(folder, device, shape):
            times = read_times(folder, device, shape)
            if times is not None:
                found[shape] = times
    return found
