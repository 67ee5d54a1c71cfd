"""`ntc-viewer bench` and `ntc-viewer study NAME`: `viewer.cli.arguments` imports this module by its name."""

from lab.commands.options import (
    AblationStudyOptions,
    BenchOptions,
    ClusterStudyOptions,
    FilteringStudyOptions,
    FreezingStudyOptions,
    MaterialStudyOptions,
    MlpSizeStudyOptions,
    PaperScenesOptions,
    PaperStudyOptions,
    RateStudyOptions,
    StabilityStudyOptions,
)
from viewer.cli.options import Subcommand

SUBCOMMANDS = (Subcommand("bench", BenchOptions, "lab.commands.bench", "bench"),)
STUDIES = (
    Subcommand("clusters", ClusterStudyOptions, "lab.commands.study_clusters", "study_clusters"),
    Subcommand("filtering", FilteringStudyOptions, "lab.commands.study_filtering", "study_filtering"),
    Subcommand("paper-textures", PaperStudyOptions, "lab.commands.study_paper", "study_paper_textures"),
    Subcommand("paper-scenes", PaperScenesOptions, "lab.commands.study_paper", "study_paper_scenes"),
    Subcommand("rate", RateStudyOptions, "lab.commands.study_rate", "study_rate"),
    Subcommand("materials", MaterialStudyOptions, "lab.commands.study_materials", "study_materials"),
    Subcommand("freezing", FreezingStudyOptions, "lab.commands.study_recipe", "study_recipe"),
    Subcommand("mlp-size", MlpSizeStudyOptions, "lab.commands.study_recipe", "study_recipe"),
    Subcommand("ablation", AblationStudyOptions, "lab.commands.study_recipe", "study_recipe"),
    Subcommand("stability", StabilityStudyOptions, "lab.commands.study_stability", "study_stability"),
)
