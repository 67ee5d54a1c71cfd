"""Groupings to compare, each with its training. They differ only in the grouping."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ntc.codec.config import DEFAULT_CLUSTERS, UNIVERSAL, GroupingConfig, GroupingName
from ntc.codec.encoding import CancelQuestion, file_header_bytes, texture_set
from ntc.codec.model import Grouping
from ntc.codec.registry import codec_named
from ntc.codec.textures import SourceTexture
from ntc.grouping import GroupingInputs, make_grouping
from ntc.training.messages import TrainingRequest
from ntc.training.turns import SampledTexels, TrainingInTurns
from viewer.sharing.settings import SharingSettings

CLUSTERED_BY_COUNT: tuple[GroupingName, ...] = ("clustered", "covisible", "random")
"""Groupings with a number of groups to choose."""
TEXTURES_PER_GROUP = 4
"""Textures per group where no number of groups is given."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """Grouping and seed to train, with the request for the trainer."""

    grouping: Grouping
    seed: int
    request: TrainingRequest

    @property
    def name(self) -> str:
        """Name in tables and files: `clustered-4`, or `baseline` for a grouping without a number of groups to choose."""
        has_count = self.grouping.name in CLUSTERED_BY_COUNT
        return f"{self.grouping.name}-{self.grouping.group_count}" if has_count else self.grouping.name


def compared_groupings(
    settings: SharingSettings, textures: Sequence[SourceTexture], inputs: GroupingInputs
) -> list[Grouping]:
    """Return each grouping of `settings` with each number of groups. Raises InputError as `make_grouping` does."""
    usual = max(2, min(DEFAULT_CLUSTERS, len(textures) // TEXTURES_PER_GROUP))
    counts = settings.clusters or (min(usual, len(textures)),)
    groupings = []
    for name in settings.groupings:
        numbers = counts if name in CLUSTERED_BY_COUNT else (None,)
        groupings += [
            make_grouping(GroupingConfig(name, clusters, seed=settings.seeds[0]), textures, inputs)
            for clusters in numbers
        ]
    return groupings


def candidates(
    settings: SharingSettings, textures: Sequence[SourceTexture], groupings: Sequence[Grouping]
) -> list[Candidate]:
    """Return a candidate for each of `groupings` and each seed, all with the same codec settings.

    The target bitrate counts codes alone; decoders add to the size of the file. Raises InputError for bits out of reach.
    """
    codec, choices = codec_named(settings.codec), settings.choices
    made = []
    for grouping in groupings:
        # One decoder is assumed for all groupings, so that a decoder per texture does not leave fewer bits for codes.
        decoders = 0 if grouping.name == UNIVERSAL else 1
        header = file_header_bytes(textures, replace(grouping, name="single", groups=(0,) * len(textures)))
        config = codec.settings_for(texture_set(textures, decoders, choices.levels, header), choices)
        for seed in settings.seeds:
            options = codec.options_for(replace(choices, seed=seed))
            made.append(Candidate(grouping, seed, TrainingRequest(tuple(textures), grouping, config, options)))
    return made


class CandidateTraining:
    """Training of a candidate, in turns with the others."""

    def __init__(
        self, candidate: Candidate, sample: SampledTexels, cancelled: CancelQuestion, state: Path | None = None
    ) -> None:
        """Begin the training. Its curve is measured on `sample`. With `state` it continues from that file, if there is one.

        Raises InputError for a request that cannot be trained, and for a file that is not a state of this training.
        """
        self.candidate, self.state = candidate, state
        self.training = TrainingInTurns(candidate.request, sample, cancelled, state)

    @property
    def share(self) -> float:
        """Progress of the training, 0 to 1."""
        latest = self.training.latest
        return 1.0 if self.training.ended else 0.0 if latest is None else latest.share


def train_in_turns(trainings: Sequence[CandidateTraining]) -> Iterator[CandidateTraining]:
    """Train all candidates to the end, one slice each in turn. Yields a training after each of its slices.

    Raises TrainingCancelledError, and the exceptions of a training.
    """
    left = list(trainings)
    while left:
        for each in tuple(left):
            each.training.run_slice()
            yield each
            if each.training.ended is not None:
                left.remove(each)
