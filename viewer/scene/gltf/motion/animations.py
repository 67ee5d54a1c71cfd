"""Animations of nodes: key frames, and interpolated values at a time (glTF 2.0, Sec. 3.11 and appendix C)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from msgspec import UNSET
from numpy.typing import NDArray

from viewer.scene.gltf import schema
from viewer.scene.gltf.buffers import Accessors, normalize
from viewer.scene.gltf.container import GltfFile
from viewer.scene.model import AnimationFacts
from viewer.scene.report import ReportNotes

AnimatedPath = Literal["translation", "rotation", "scale", "weights"]
NodeValues = Mapping[tuple[int, AnimatedPath], NDArray[np.float64]]
"""Animated values by node and property: translations [3], rotations [4] as xyzw, scales [3], weights [targets]."""
COMPONENTS: dict[AnimatedPath, tuple[str, int]] = {
    "translation": ("VEC3", 3),
    "rotation": ("VEC4", 4),
    "scale": ("VEC3", 3),
    "weights": ("SCALAR", 1),
}
NEARLY_PARALLEL = 1.0 - 1e-9
"""Cosine of the angle between quaternions above which they are interpolated linearly: slerp would divide by almost 0."""


@dataclass(frozen=True, eq=False)
class Channel:
    """Key frames of one property of one node."""

    node: int
    path: AnimatedPath
    interpolation: schema.Interpolation
    times: NDArray[np.float64]
    """[K] seconds, ascending."""
    values: NDArray[np.float64]
    """[K, C], for CUBICSPLINE [K, 3, C]: in-tangent, value, out-tangent."""

    def at(self, seconds: float) -> NDArray[np.float64]:
        """Return [C] the value at a time, clamped to the first and the last key. Rotations have unit length."""
        times = self.times
        after = int(np.searchsorted(times, seconds, side="right"))
        keys = self.values[:, 1] if self.interpolation == "CUBICSPLINE" else self.values
        if after == 0 or after == len(times) or self.interpolation == "STEP":
            value = keys[max(0, after - 1)]
        else:
            span = times[after] - times[after - 1]
            share = (seconds - times[after - 1]) / span
            if self.interpolation == "CUBICSPLINE":
                value = _spline(self.values[after - 1], self.values[after], share, span)
            elif self.path == "rotation":
                value = _arc(keys[after - 1], keys[after], share)
            else:
                value = keys[after - 1] * (1.0 - share) + keys[after] * share
        if self.path != "rotation":
            return np.asarray(value)
        length = float(np.linalg.norm(value))
        return np.asarray(value / length) if length > 0.0 else np.array([0.0, 0.0, 0.0, 1.0])


def _spline(before: NDArray[np.float64], after: NDArray[np.float64], share: float, span: float) -> NDArray[np.float64]:
    squared, cubed = share**2, share**3
    start = (2.0 * cubed - 3.0 * squared + 1.0) * before[1] + span * (cubed - 2.0 * squared + share) * before[2]
    end = (3.0 * squared - 2.0 * cubed) * after[1] + span * (cubed - squared) * after[0]
    return np.asarray(start + end)


def _arc(before: NDArray[np.float64], after: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Return the spherical linear interpolation (slerp) of two quaternions, along the shorter arc."""
    cosine = float(before @ after)
    after, cosine = (-after, -cosine) if cosine < 0.0 else (after, cosine)
    if cosine > NEARLY_PARALLEL:
        return before * (1.0 - share) + after * share
    angle = np.arccos(cosine)
    return np.asarray((np.sin((1.0 - share) * angle) * before + np.sin(share * angle) * after) / np.sin(angle))


@dataclass(frozen=True, eq=False)
class Animation:
    """Animation of the file: a name, and channels that run together."""

    name: str
    channels: tuple[Channel, ...]

    @property
    def facts(self) -> AnimationFacts:
        """Name and length of the animation."""
        return AnimationFacts(self.name, max((float(channel.times[-1]) for channel in self.channels), default=0.0))

    def at(self, seconds: float) -> NodeValues:
        """Return the values of all channels at a time."""
        return {(channel.node, channel.path): channel.at(seconds) for channel in self.channels}


def read_animations(file: GltfFile, accessors: Accessors, notes: ReportNotes) -> tuple[Animation, ...]:
    """Return all animations of the file. Channels that do not move a property of a node are left out.

    Raises InputError for key frames that are out of range, not ascending, or too few.
    """
    animations: list[Animation] = []
    taken: set[str] = set()
    for number, named in enumerate(file.entries("animations")):
        where, entry = f"animations[{number}]", file.entry("animations", number, schema.Animation)
        channels: list[Channel] = []
        for place, channel in enumerate(entry.channels):
            read = _channel(file, accessors, channel, entry.samplers, f"{where}.channels[{place}]", where)
            if read is None:
                notes.ignored("animated properties of something else than nodes: channels")
            else:
                channels.append(read)
        name = file.label(named, f"animation {number}")
        name = name if name not in taken else f"{name} ({number})"
        taken.add(name)
        animations.append(Animation(name, tuple(channels)))
    notes.honoured("animations", len(animations))
    return tuple(animations)


def _channel(
    file: GltfFile,
    accessors: Accessors,
    channel: schema.AnimationChannel,
    samplers: Sequence[Any],
    where: str,
    owner: str,
) -> Channel | None:
    path = channel.target.path
    if channel.target.node is UNSET or not isinstance(path, str) or path not in COMPONENTS:
        return None
    node = file.index(channel.target.node, len(file.entries("nodes")), f"{where}.target.node")
    number = file.index(channel.sampler, len(samplers), f"{where}.sampler")
    field = f"{owner}.samplers[{number}]"
    sampler = file.read(samplers[number], schema.AnimationSampler, field)
    interpolation = sampler.interpolation
    times = accessors.floats(sampler.input, f"{field}.input", ("SCALAR",))[:, 0].astype(np.float64)
    kind, components = COMPONENTS[path]
    raw = accessors.raw(sampler.output, f"{field}.output", (kind,))
    # Integers are normalised fractions, whatever the accessor says.
    values = normalize(raw).astype(np.float64)
    if len(times) == 0 or not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        raise file.fail(f"{field}.input", "must be ascending times in seconds, one at least")
    if not np.isfinite(values).all():
        raise file.fail(f"{field}.output", "holds NaN or infinity")
    rows = len(times) * (3 if interpolation == "CUBICSPLINE" else 1)
    if path == "weights":
        components = len(values) // rows
    if components == 0 or values.size != rows * components:
        raise file.fail(f"{field}.output", f"has {len(values)} elements for {len(times)} key frames")
    shape = (len(times), 3, components) if interpolation == "CUBICSPLINE" else (len(times), components)
    return Channel(node, path, interpolation, times, values.reshape(shape))
