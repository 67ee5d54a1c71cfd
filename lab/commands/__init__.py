"""Subcommands `ntc-viewer bench` and `ntc-viewer study NAME`. `viewer.cli.arguments` imports this module by name."""

from lab.commands.options import (
    BenchOptions,
    PaperScenesOptions,
    PaperStudyOptions,
    RateStudyOptions,
    StabilityStudyOptions,
)
from viewer.cli.options import Subcommand

SUBCOMMANDS = (Subcommand("bench", BenchOptions, "lab.commands.bench", "bench"),)
STUDIES = (
    Subcommand("paper-textures", PaperStudyOptions, "lab.commands.study_paper", "study_paper_textures"),
    Subcommand("paper-scenes", PaperScenesOptions, "lab.commands.study_paper", "study_paper_scenes"),
    Subcommand("rate", RateStudyOptions, "lab.commands.study_rate", "study_rate"),
    Subcommand("stability", StabilityStudyOptions, "lab.commands.study_stability", "study_stability"),
)
