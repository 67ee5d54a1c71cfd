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
    """Time every pack of a scene by every decode path, and name the path to take. `--thorough` measures more and takes minutes."""

    json: Annotated[Path | None, in_words("F.json")] = None
    """Record to write. Tables (.md) and plots (.png) are written beside it, each when it is done. Default: print only."""
    scene: OptionalScene = None
    """glTF scene. `gallery`: the built-in spheres. Default: the built-in courtyard."""
    pack: Packs = ()
    """Packs to time besides those beside the scene (NAME.*.ntc)."""
    what: Annotated[Literal["all", "worst-case", "scene"] | None, in_words("all|worst-case|scene")] = None
    """Parts to time. Default: the scene; with --thorough all."""
    thorough: Switch = False
    """Time all cameras, all precisions, and the worst case with all decoders in every block."""
    size: Annotated[Size | None, in_words("WIDTHxHEIGHT")] = None
    """Size of the scene's pictures in pixels. Default: 640x360; without a GPU and without --thorough 320x180."""
    worst_sizes: Annotated[Sizes | None, in_words("WIDTHxHEIGHT ...")] = None
    """Sizes of the pictures of the worst case in pixels. Default: 512x512; on a GPU also its doubles up to 8192x8192."""
    decoders: tuple[int, ...] = (1, 5, 10, 20)
    """Numbers of decoders in every block of the worst case."""
    codec: RecipeName = "best"
    """Recipe of codec `grid` that the worst case decodes."""
    hidden_width: Annotated[int | None, in_words("N")] = None
    """Neurons of each hidden layer of that codec. Default: the recipe's."""
    memory_mb: int = 4096
    """Memory limit of a picture in MiB. A larger picture of the worst case is decoded in tiles; one of a scene is refused."""
    paths: tuple[DecodePath, ...] = get_args(DecodePath)
    """Decode paths of the scene."""
    precisions: Annotated[tuple[Precision, ...] | None, in_words("fp32|fp16|... ...")] = None
    """Number formats of decoder weights and arithmetic. Default: fp32; with --thorough all that the driver supports."""
    formats: Annotated[tuple[BlockFormat, ...], in_words("FORMAT ...")] = ()
    """Block formats to measure in the scene beside the packs, e.g. bc7 astc-8x8 (needs the extra `lab`)."""
    filters: tuple[TexelFilter, ...] = ("exact",)
    """Filters of the scene's paths except cached: exact, stochastic (times one sample, compares the mean of 16), or both."""
    views: Annotated[Path | None, in_words("FILE")] = None
    """JSON file of cameras. Default: the scene's first camera, with --thorough all of them; without cameras the whole scene."""
    repeats: Annotated[int | None, in_words("N")] = None
    """Timed frames of each candidate; figures are medians. Default: 3; with --thorough 5."""
    device: Gpu = None


@dataclass(frozen=True)
class StabilityStudyOptions:
    """Compare every decode path in every precision with float64 and certified bounds, on ordinary and hostile cases."""

    out: Path
    """Folder for stability.md, stability.csv, stability.json and stability.png."""
    scene: OptionalScene = None
    """glTF scene. `gallery`: the built-in spheres. Default: the built-in courtyard."""
    pack: Packs = ()
    """Packs to measure besides those beside the scene (NAME.*.ntc)."""
    grouping: tuple[str, ...] = ("clustered", "single")
    """Groupings of the packs beside the scene that are measured."""
    texels: int = 2000
    """Texels of each case."""
    bound_texels: int = 100_000
    """Number of random texels, over all cases, at which certified bounds are checked."""
    size: Size = (96, 54)
    """Size of the scene's pictures in pixels."""
    precisions: tuple[Precision, ...] = get_args(Precision)
    """Precisions to measure; those that the driver lacks are emulated."""
    seed: int = 0
    """Seed of random weights and coordinates."""


@dataclass(frozen=True)
class TrainingStudyOptions:
    """Options that all studies with trainings share."""

    source: Annotated[Path, tyro.conf.arg(metavar="SCENE|FOLDER"), tyro.conf.Positional]
    """glTF scene, or a folder of images."""
    out: Path
    """Folder for tables (.md, .csv), figures as JSON, plots (.png) and finished runs. A stopped study resumes from it."""
    clusters: Annotated[int | None, in_words("N")] = None
    """Number of decoders of clustered, random and covisible. Default: 10, or one per texture where there are fewer textures."""
    scale: ScaleName = StudySettings.scale
    """Length of trainings. small: minutes on two cores. paper: 350 epochs at 1024 texels, for a GPU."""
    steps: int = StudySettings.steps
    """Optimisation steps of each run at scale small."""
    texels_per_texture: int = StudySettings.texels_per_texture
    """Samples of each texture per step at scale small."""
    texture_size: Annotated[int | None, in_words("N")] = None
    """Largest side of a texture in texels; larger ones are reduced. Default: 256 at scale small, 1024 at scale paper."""
    levels: int | None = StudySettings.levels
    """Latent levels. 1: only mip 0, as in the paper. None: all mips."""
    seeds: tuple[int, ...] = StudySettings.seeds
    """Seeds; figures are means over them."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Device to train on."""

    def settings(self) -> StudySettings:
        """Return the settings of the trainings. Raises InputError for impossible ones."""
        if self.texture_size is not None and self.texture_size < 1:
            raise InputError(f"--texture-size {self.texture_size}: must be positive")
        return StudySettings(self.scale, self.steps, self.texels_per_texture, self.seeds, self.levels, self.device)

    def side(self) -> int:
        """Return the largest side of a texture in texels."""
        return self.texture_size or (256 if self.scale == "small" else 1024)


@dataclass(frozen=True)
class RateStudyOptions:
    """Measure rate and distortion of both codecs beside BC1, BC7, ASTC and beside files: JPEG, XUASTC, ETC1S, JPEG XL.
    All bytes count."""

    source: Annotated[Path, tyro.conf.arg(metavar="SCENE|FOLDER"), tyro.conf.Positional]
    """glTF scene, or a folder of images."""
    out: Path
    """Folder for rate.md, rate.csv, rate.json, rate.png and finished trainings of codec grid. A stopped study resumes from it."""
    texture_size: int = 512
    """Largest side of a texture in texels; larger ones are reduced."""
    most: int = 16
    """Largest number of textures, evenly chosen among all of them."""
    clusters: int = 4
    """Number of decoders of grouping clustered."""
    groupings: tuple[GroupingName, ...] = ("clustered", "single", "baseline")
    """Groupings of codec block."""
    sides: tuple[BlockSide, ...] = (8, 4)
    """Sides of the blocks of codec block, in texels."""
    bits: tuple[float, ...] = (0.9, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
    """Bitrates of codec block in bits per texel of mip 0, all mips and tables included."""
    formats: Annotated[tuple[BlockFormat, ...], in_words("FORMAT ...")] = BLOCK_FORMATS
    """Block formats of graphics hardware, such as bc7 astc-8x8, at the encoders' highest effort (extra `lab`).
    Default: all."""
    grid_steps: int = 300
    """Steps of each of the four trainings of codec grid by recipe best, clustered. More steps take longer; 0 leaves grid out."""
    disk_formats: Annotated[tuple[DiskFormat, ...], in_words("jpeg|xuastc|etc1s ...")] = DISK_FORMATS
    """Formats of files with all mips, compared by bytes of whole files (extra `export`). Default: all."""
    jpeg_xl: bool = True
    """Measure JPEG XL too, as a bound without random access."""
    flip_every: int = 4
    """Distance between textures whose FLIP is measured: 4 measures every fourth texture, because FLIP is slow."""


@dataclass(frozen=True)
class PaperStudyOptions(TrainingStudyOptions):
    """Reproduce the paper's Table 2: PSNR of textures by grouping, for the paper's recipe and for best, beside BC1 and BC7."""

    groupings: tuple[GroupingName, ...] = ()
    """Groupings to measure. Default: those of the paper."""
    blocks: Switch = False
    """Also compress the images as BC1 and BC7 (needs the extra `lab`)."""


@dataclass(frozen=True)
class PaperScenesOptions(PaperStudyOptions):
    """Reproduce the paper's Tables 3 and 4: textures of a scene, rendered pictures and divergence by grouping."""

    views: Annotated[Path | None, in_words("FILE")] = None
    """JSON file of cameras. Default: the cameras of the scene."""
    sampled_views: Annotated[int | None, in_words("N")] = None
    """Number of viewpoints sampled in the scene for grouping covisible, besides the cameras. Default: 24 without cameras."""
    more_clusters: tuple[int, ...] = ()
    """Further numbers of decoders for clustered and covisible under recipe best."""
    size: Size = (640, 360)
    """Size of the rendered pictures in pixels."""
