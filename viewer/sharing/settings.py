"""Settings of a comparison of groupings."""

from dataclasses import dataclass

from ntc.codec.config import UNIVERSAL, GroupingName
from ntc.codec.encoding import BitsTarget, DeviceName, EncodingChoices
from ntc.codec.registry import CodecName, codec_named
from ntc.errors import InputError


@dataclass(frozen=True)
class SharingSettings:
    """Settings of a comparison: codec, groupings, seeds and length of training."""

    codec: CodecName = "grid"
    groupings: tuple[GroupingName, ...] = ("baseline", "clustered", "covisible", "single")
    clusters: tuple[int, ...] = ()
    """Numbers of groups of clustered, covisible and random; empty: a quarter of the number of textures."""
    steps: int = 1000
    """Training steps of each grouping. A codec without training ignores them."""
    bits: float | None = None
    """Bits per texel of the codes, for codec `block`; None: the codec's default."""
    seeds: tuple[int, ...] = (0,)
    """Seeds of the trainings. Groupings are made with the first seed."""
    device: DeviceName = "auto"

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise InputError(f"--steps {self.steps}: must be at least 1")
        for name, values in (("groupings", self.groupings), ("clusters", self.clusters), ("seed", self.seeds)):
            if len(set(values)) != len(values):
                raise InputError(f"--{name}: names {next(v for v in values if values.count(v) > 1)} twice")
        if not self.groupings or not self.seeds:
            raise InputError("--groupings and --seed: name at least one")
        trains = codec_named(self.codec).trains
        if trains and self.bits is not None:
            raise InputError(f"--bits: codec {self.codec} stores a fixed number of bits; leave it out")
        if trains and UNIVERSAL in self.groupings:
            raise InputError(f"--groupings {UNIVERSAL}: codec {self.codec} ships no decoder; use --codec block")
        if not trains and len(self.seeds) > 1:
            raise InputError(f"--seed: codec {self.codec} draws no random numbers; name one seed")

    @property
    def choices(self) -> EncodingChoices:
        """Options of each encoding, without the seed."""
        trains = codec_named(self.codec).trains
        target = None if self.bits is None else BitsTarget(self.bits)
        return EncodingChoices(steps=self.steps if trains else None, target=target, device=self.device)
