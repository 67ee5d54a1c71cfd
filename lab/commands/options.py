"""Options of `ntc-viewer bench` and `ntc-viewer study NAME`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from lab.studies.settings import DISK_FORMATS, BlockSide, DiskFormat, ScaleName, StudySettings
from ntc.codec.config import GroupingName
from ntc.codec.encoding import RecipeName
from ntc.errors import InputError
from ntc.metrics.block_compression import BLOCK_FORMATS, BlockFormat
from viewer.cli.options import DecoderOptions, Gpu, OptionalScene, Packs, Size, Sizes, Switch, in_words
from viewer.state.view_state import DecodePath, Precision, TexelFilter


@dataclass(frozen=True)
class BenchOptions(DecoderOptions):
    """Time every pack of a scene by every decode path, and name the path to take. `--thorough` measures more, in many minutes."""

    json: Annotated[Path | None, in_words("F.json")] = None
    """Record to write. Tables (.md) and plots (.png) are written beside it, each as soon as it is done. Default: print only."""
    scene: OptionalScene = None
    """glTF scene. `gallery`: the built-in spheres. Default: the built-in courtyard."""
    pack: Packs = ()
    """Packs to time besides those found beside the scene (NAME.*.ntc)."""
    what: Annotated[Literal["all", "worst-case", "scene"] | None, in_words("all|worst-case|scene")] = None
    """Parts to time. Default: the scene; with --thorough all."""
    thorough: Switch = False
    """Time all cameras, all precisions and the worst case: all decoders in every block."""
    size: Annotated[Size | None, in_words("WIDTHxHEIGHT")] = None
    """Pixels of the scene's pictures. Default: 640x360; without a GPU 320x180, with --thorough 640x360."""
    worst_sizes: Annotated[Sizes | None, in_words("WIDTHxHEIGHT ...")] = None
    """Pixels of the worst case, each size in turn. Default: 512x512, and on a GPU its doubles up to 8192x8192."""
    decoders: tuple[int, ...] = (1, 5, 10, 20)
    """Decoders that meet in every block of the worst case; each number in turn."""
    codec: RecipeName = "best"
    """Recipe of codec `grid` that the worst case decodes."""
    hidden_width: Annotated[int | None, in_words("N")] = None
    """Neurons of each hidden layer of that codec. Default: the recipe's."""
    memory_mb: int = 4096
    """MiB that pictures may take. A larger one of the worst case is decoded in tiles; one of a scene is refused."""
    paths: tuple[DecodePath, ...] = get_args(DecodePath)
    """Decode paths of the scene."""
    precisions: Annotated[tuple[Precision, ...] | None, in_words("fp32|fp16|... ...")] = None
    """Storage of decoder weights and arithmetic with them. Default: fp32; with --thorough all that the driver has."""
    formats: Annotated[tuple[BlockFormat, ...], in_words("FORMAT ...")] = ()
    """Formats of graphics hardware to show in the scene beside the packs, e.g. bc7 astc-8x8 (needs the extra `lab`)."""
    filters: tuple[TexelFilter, ...] = ("exact",)
    """Filters of the scene's paths: exact, stochastic (one sample is timed, the mean of 16 compared), or both; cached has its own."""
    views: Annotated[Path | None, in_words("FILE")] = None
    """JSON file of cameras. Default: the scene's first camera, with --thorough all of them; without cameras the whole scene."""
    repeats: Annotated[int | None, in_words("N")] = None
    """Timed frames of each; figures are medians. Default: 3; with --thorough 5."""
    device: Gpu = None


@dataclass(frozen=True)
class StabilityStudyOptions:
    """Every decode path in every precision against float64 and certified bounds, on ordinary and hostile cases."""

    out: Path
    """Folder for stability.md, stability.csv, stability.json and stability.png."""
    scene: OptionalScene = None
    """glTF scene. `gallery`: the built-in spheres. Default: the built-in courtyard."""
    pack: Packs = ()
    """Packs to measure besides those found beside the scene (NAME.*.ntc)."""
    grouping: tuple[str, ...] = ("clustered", "single")
    """Packs of the scene that are measured, by grouping."""
    texels: int = 2000
    """Texels of each case."""
    bound_texels: int = 100_000
    """Random texels at which certified bounds are checked, in all."""
    size: Size = (96, 54)
    """Pixels of the pictures of the scene."""
    precisions: tuple[Precision, ...] = get_args(Precision)
    """Precisions; what the driver cannot compute is emulated."""
    seed: int = 0
    """Seed of random weights and places."""


@dataclass(frozen=True)
class TrainingStudyOptions:
    """What studies that train have in common."""

    source: Annotated[Path, tyro.conf.arg(metavar="SCENE|FOLDER"), tyro.conf.Positional]
    """glTF scene, or a folder of images."""
    out: Path
    """Folder for tables (.md, .csv), figures as JSON, plots (.png), and for the finished runs: stopped, a study goes on."""
    clusters: Annotated[int | None, in_words("N")] = None
    """Decoders of clustered, random and covisible. Default: 10, or one for each texture where there are fewer."""
    scale: ScaleName = StudySettings.scale
    """small: minutes on two cores. paper: 350 epochs at 1024 texels, for a GPU."""
    steps: int = StudySettings.steps
    """Optimisation steps of each run at the small scale."""
    texels_per_texture: int = StudySettings.texels_per_texture
    """Samples of each texture in a step at the small scale."""
    texture_size: Annotated[int | None, in_words("N")] = None
    """Textures are reduced to at most this many texels a side. Default: 256 at the small scale, else 1024."""
    levels: int | None = StudySettings.levels
    """Latent levels. 1: mip 0 alone, as in the paper. None: all mips."""
    seeds: tuple[int, ...] = StudySettings.seeds
    """Seeds; figures are means over them."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where to train."""

    def settings(self) -> StudySettings:
        """What the options say about the trainings. Raises InputError for what cannot be."""
        if self.texture_size is not None and self.texture_size < 1:
            raise InputError(f"--texture-size {self.texture_size}: must be positive")
        return StudySettings(self.scale, self.steps, self.texels_per_texture, self.seeds, self.levels, self.device)

    def side(self) -> int:
        """Texels a side at most."""
        return self.texture_size or (256 if self.scale == "small" else 1024)


@dataclass(frozen=True)
class RateStudyOptions:
    """Rate and distortion: both codecs beside BC1, BC7, ASTC, and beside files: JPEG, XUASTC, ETC1S, JPEG XL. All bytes count."""

    source: Annotated[Path, tyro.conf.arg(metavar="SCENE|FOLDER"), tyro.conf.Positional]
    """glTF scene, or a folder of images."""
    out: Path
    """Folder for rate.md, rate.csv, rate.json, rate.png, and for finished trainings of codec grid: stopped, a study goes on."""
    texture_size: int = 512
    """Textures are reduced to at most this many texels a side."""
    most: int = 16
    """Textures at most: evenly chosen among all of them."""
    clusters: int = 4
    """Decoders of clustered."""
    groupings: tuple[GroupingName, ...] = ("clustered", "single", "baseline")
    """Groupings of codec block."""
    sides: tuple[BlockSide, ...] = (8, 4)
    """Texels of its blocks along one side."""
    bits: tuple[float, ...] = (0.9, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
    """Bits per texel of mip 0 of codec block, all mips and tables together."""
    formats: Annotated[tuple[BlockFormat, ...], in_words("FORMAT ...")] = BLOCK_FORMATS
    """Formats of graphics hardware, such as bc7 astc-8x8, at the encoders' highest effort (extra `lab`).
    Default: all."""
    grid_steps: int = 300
    """Steps of each of the four trainings of codec grid by recipe best, clustered; few, so that the study ends. 0: none of them."""
    disk_formats: Annotated[tuple[DiskFormat, ...], in_words("jpeg|xuastc|etc1s ...")] = DISK_FORMATS
    """Formats of files, with all mips (the extra `export`): bytes of whole files are compared. Default: all."""
    jpeg_xl: bool = True
    """Whether JPEG XL, a bound without random access, is measured."""
    flip_every: int = 4
    """FLIP, which takes longest, is the mean over every so many textures."""


@dataclass(frozen=True)
class PaperStudyOptions(TrainingStudyOptions):
    """The paper's Table 2 again: PSNR of textures by grouping, for its recipe and for best, beside BC1 and BC7."""

    groupings: tuple[GroupingName, ...] = ()
    """Which groupings. None named: those of the paper."""
    blocks: Switch = False
    """Compress the same images as BC1 and BC7 too (needs the extra `lab`)."""


@dataclass(frozen=True)
class PaperScenesOptions(PaperStudyOptions):
    """The paper's Tables 3 and 4 again: textures of a scene, rendered pictures and divergence by grouping."""

    views: Annotated[Path | None, in_words("FILE")] = None
    """JSON file of cameras. Default: the scene's own."""
    sampled_views: Annotated[int | None, in_words("N")] = None
    """Let covisible look from this many places sampled in the scene too. Default: 24 where there are no cameras."""
    more_clusters: tuple[int, ...] = ()
    """Further numbers of decoders for clustered and covisible under best."""
    size: Size = (640, 360)
    """Pixels of the rendered pictures."""
