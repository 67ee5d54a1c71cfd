"""Every subcommand and its options: frozen dataclasses that tyro turns into the command line (see README)."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from ntc.codec.config import FeatureName, GroupingConfig, GroupingName, PrecisionChoice
from ntc.codec.encoding import DeviceName, PresetName, RecipeName
from ntc.codec.gpu import VariantName
from ntc.codec.maps import MapWeightsName
from ntc.codec.registry import CodecName
from viewer.export import Fallback, ImageFormat, ShaderLanguage
from viewer.scene.cameras_file import CAMERAS_TEXT
from viewer.scene.source_textures import MapChoice
from viewer.sharing.settings import SharingSettings
from viewer.state.palettes import PaletteName
from viewer.state.setting import field_args, field_text
from viewer.state.settings import ViewerSettings
from viewer.state.view_state import (
    Anisotropy,
    BlockName,
    Lighting,
    MaterialView,
    Overlay,
    PathChoice,
    Precision,
    ScaleName,
    Slot,
    TexelFilter,
    ToneMap,
    ViewState,
)
from viewer.training.settings import TARGET_TEXTS, TargetUnit, TrainingSettings

LARGEST_SIDE = 16384
"""Largest side of a picture that options accept, in pixels."""


def _parse_size(arguments: list[str]) -> tuple[int, int]:
    width, separator, height = arguments[0].lower().partition("x")
    if not (separator and width.isdigit() and height.isdigit()):
        raise ValueError(f"{arguments[0]!r} is not WIDTHxHEIGHT, e.g. 1280x720")
    size = int(width), int(height)
    if not all(1 <= side <= LARGEST_SIDE for side in size):
        raise ValueError(f"{arguments[0]!r}: each side must be 1 to {LARGEST_SIDE} pixels")
    return size


Size = Annotated[
    tuple[int, int],
    tyro.constructors.PrimitiveConstructorSpec(
        nargs=1,
        metavar="WIDTHxHEIGHT",
        instance_from_str=_parse_size,
        is_instance=lambda value: isinstance(value, tuple) and len(value) == 2,
        str_from_instance=lambda size: [f"{size[0]}x{size[1]}"],
    ),
]
Sizes = tuple[Size, ...]
OptionalScene = Annotated[Path | None, tyro.conf.arg(metavar="SCENE", help_behavior_hint=""), tyro.conf.Positional]


def _parse_vector(arguments: list[str]) -> tuple[float, float, float]:
    x, y, z = (float(argument) for argument in arguments)
    if not all(math.isfinite(value) for value in (x, y, z)):
        raise ValueError(f"{' '.join(arguments)!r} is not three finite numbers")
    return x, y, z


Vector = Annotated[
    tuple[float, float, float] | None,
    tyro.constructors.PrimitiveConstructorSpec(
        nargs=3,
        metavar="X Y Z",
        instance_from_str=_parse_vector,
        is_instance=lambda value: value is None or (isinstance(value, tuple) and len(value) == 3),
        str_from_instance=lambda value: ["none"] if value is None else [str(number) for number in value],
    ),
]


@dataclass(frozen=True)
class QualityGoal:
    """Quality to reach with as few bits as possible."""

    value: float
    unit: Literal["dB", "JOD"] = "dB"
    """dB: PSNR of each texture. JOD: ColorVideoVDP of each lit view."""

    def __str__(self) -> str:
        return f"{self.value:g}{'' if self.unit == 'dB' else 'jod'}"


def _parse_quality(arguments: list[str]) -> QualityGoal:
    text = arguments[0].lower()
    try:
        return QualityGoal(float(text.removesuffix("jod").removesuffix("db")), "JOD" if text.endswith("jod") else "dB")
    except ValueError:
        raise ValueError(f"{arguments[0]!r} is not a quality, e.g. 40 (dB) or 9.5jod") from None


Quality = Annotated[
    QualityGoal | None,
    tyro.constructors.PrimitiveConstructorSpec(
        nargs=1,
        metavar="DB|Xjod",
        instance_from_str=_parse_quality,
        is_instance=lambda value: value is None or isinstance(value, QualityGoal),
        str_from_instance=lambda value: [str(value)],
    ),
]


def in_words(metavar: str) -> Any:
    """Return the tyro setting of an option whose help states its default in words, in place of `(default: None)`."""
    return tyro.conf.arg(metavar=metavar, help_behavior_hint="")


def _shown(owner: type, field: str, more: str = "", metavar: str | None = None) -> Any:
    """Return the tyro setting of an option with the same effect as the field `field` of `owner`: the field's help, then `more`.

    Give a `metavar` where the help states the default in words.
    """
    text = " ".join(filter(None, (field_text(owner, field), more)))
    return (
        tyro.conf.arg(help=text)
        if metavar is None
        else tyro.conf.arg(help=text, metavar=metavar, help_behavior_hint="")
    )


def _cameras(more: str) -> Any:
    """Return the tyro setting of an option that takes a cameras file."""
    return tyro.conf.arg(help=f"{CAMERAS_TEXT}. {more}", metavar="FILE", help_behavior_hint="")


def _sun() -> Any:
    """Return the tyro setting of the sun's direction, with the texts that its two angles have in the window."""
    angles = (field_args(Lighting)[name] for name in ("sun_azimuth", "sun_elevation"))
    text = " and ".join(f"{angle.name} in {angle.help}" for angle in angles)
    return tyro.conf.arg(help=f"Direction of the sun: {text}.", metavar="AZIMUTH ELEVATION")


def _target(unit: TargetUnit, metavar: str, more: str = "") -> Any:
    """Return the tyro setting of an option for the target in a unit."""
    text = " ".join(filter(None, (f"Target of codec block: {TARGET_TEXTS[unit]}.", more)))
    return tyro.conf.arg(help=text, metavar=metavar, help_behavior_hint="")


Packs = Annotated[tuple[Path, ...], in_words("F.ntc ...")]
Lines = Annotated[tuple[str, ...], tyro.conf.arg(metavar="'LINE; LINE'"), tyro.conf.UseAppendAction]
Switch = tyro.conf.FlagCreatePairsOff[bool]
Gpu = Annotated[
    str | None,
    tyro.conf.arg(
        metavar="N|NAME|software",
        help="GPU: its number or part of its name, as `ntc-viewer doctor` lists them, or `software`. Default: the first.",
        help_behavior_hint="",
    ),
]
"""GPU to draw on (`viewer.gl.devices.choose_device`); None: the one that NTC_VIEWER_DEVICE names, else the first one."""
GroupingOrImages = Annotated[str | None, in_words("NAME")]


@dataclass(frozen=True)
class Subcommand:
    """Subcommand of `ntc-viewer`, or one study of `ntc-viewer study`."""

    name: str
    options: type[Any]
    """Dataclass whose fields are the options and whose docstring is the summary in --help."""
    module: str
    """Module with the function. It is imported when the command runs, because most commands need neither torch nor OpenGL."""
    function: str
    """Name of the function in `module` that takes an instance of `options`, returns the exit status and raises InputError."""


@dataclass(frozen=True, kw_only=True)
class DecoderOptions:
    """Options of decoding that change the speed, but not the picture."""

    decoder_variant: VariantName | None = None
    """Layout of the decoding shaders; pictures do not depend on it. Default: `software` for a software renderer, else `gpu`."""


@dataclass(frozen=True)
class ViewOptions(DecoderOptions):
    """Open a scene in a window. Without a display, pictures are written to a folder instead."""

    scene: OptionalScene = None
    """Scene to open: .gltf, .glb, .obj, .ply, .stl, .off, a zip archive or a folder; or `gallery`, the built-in spheres.
    A folder of images is shown on panels and spheres.
    Default: the built-in courtyard."""
    pack: Packs = ()
    """Packs or libraries to open besides the packs beside the scene (NAME.*.ntc). Example: --pack a.ntc b.ntc."""
    grouping: GroupingOrImages = None
    """Source of slot A at the start: `reference`, the grouping of an open pack, or bc1, bc7, astc-4x4 to astc-12x12 (extra `lab`).
    A built-in scene is encoded in a grouping that it lacks. Default: clustered, else the first pack."""
    path: Annotated[PathChoice, _shown(Slot, "path")] = "deferred"
    precision: Annotated[PrecisionChoice, _shown(Slot, "precision")] = "fp32"
    filter: Annotated[TexelFilter | None, _shown(Slot, "filter", "Default: the last one used.", "exact|stochastic")] = (
        None
    )
    script: Annotated[Path | None, in_words("FILE")] = None
    """Script of commands to play (docs/guide/scripts.md). The window stays open afterwards."""
    exec: Lines = ()
    """Commands to play after the script's; may be repeated. Example: --exec 'camera.go market; screenshot a.png'."""
    headless: Switch = False
    """Open no window: play the script, or write one picture."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("ntc-viewer-pictures")
    """Folder for pictures, views and recorded camera paths."""
    size: Annotated[Size | None, in_words("WIDTHxHEIGHT")] = None
    """Size of the window's content in pixels. Default: the last size; 1280x720 without a window."""
    device: Annotated[str | None, in_words("N|NAME|software")] = None
    """GPU to draw on without a window: its number or part of its name, as `ntc-viewer doctor` lists them, or `software`.
    Default: the first."""


@dataclass(frozen=True)
class RenderOptions(DecoderOptions):
    """Draw one picture without a window and write it, ids, divergence and statistics into a folder."""

    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Folder to write: color.png, texture_id.npy, decoder_id.npy, divergence.npy, stats.json."""
    scene: OptionalScene = None
    """Scene to draw, or `gallery`, the built-in spheres. Default: the built-in courtyard."""
    variant: Annotated[str, in_words("NAME")] = ""
    """Material variant to draw (KHR_materials_variants). Default: the materials that the scene's parts name themselves."""
    time: Annotated[float | None, in_words("SECONDS")] = None
    """Moment of the animation to draw, in seconds from its start. Default: the scene without animation."""
    animation: Annotated[str, in_words("NAME")] = ""
    """Animation that --time refers to. Default: the first one of the file."""
    pack: Packs = ()
    """Packs or libraries to choose from besides the packs beside the scene (NAME.*.ntc)."""
    grouping: GroupingOrImages = None
    """Source of the textures: `reference` (the originals), the grouping of a pack, or bc1, bc7, astc-4x4 to astc-12x12 (extra `lab`).
    A built-in scene is encoded in a grouping that it lacks. Default: clustered, else the first pack, else reference."""
    path: Annotated[PathChoice, _shown(Slot, "path")] = "deferred"
    precision: Annotated[PrecisionChoice, _shown(Slot, "precision")] = "fp32"
    filter: Annotated[TexelFilter, _shown(Slot, "filter")] = "exact"
    size: Size = (1280, 720)
    """Picture size in pixels."""
    cameras: Annotated[Path | None, _cameras("Default: the scene's cameras.")] = None
    camera: Annotated[str | None, in_words("NAME")] = None
    """Camera to draw from. Default: the first one; without cameras, one that frames the scene."""
    eye: Vector = None
    """Position of the camera in scene units, Y up. Use it with --target. Example: --eye 0 2 5 --target 0 1 0."""
    target: Vector = None
    """Point that the camera looks at, in scene units."""
    fov: Annotated[float, _shown(ViewerSettings, "fov_degrees", "Above 0 and below 180, for --eye and --target.")] = (
        60.0
    )
    overlay: Literal["none", "divergence", "error"] = "none"
    """Overlay to write as overlay.png: decoders per block, or the error against the reference."""
    opacity: Annotated[float, _shown(Overlay, "opacity")] = 0.6
    palette: Annotated[PaletteName, _shown(Overlay, "palette")] = "green-red"
    block: Annotated[BlockName, _shown(Overlay, "block")] = Overlay.block
    scale: Annotated[ScaleName, _shown(Overlay, "scale")] = "picture"
    anisotropy: Annotated[Anisotropy, _shown(ViewState, "anisotropy")] = 1
    view: Annotated[MaterialView, _shown(ViewState, "material_view")] = "base"
    environment: Annotated[
        Path | None, _shown(Lighting, "environment", "Default: `sky`, with a sun.", "sky|studio|FILE")
    ] = None
    sun: Annotated[tuple[float, float], _sun()] = (Lighting.sun_azimuth, Lighting.sun_elevation)
    sun_strength: Annotated[float | None, _shown(Lighting, "sun_strength", "Default: 1 with the sky, else 0.", "X")] = (
        None
    )
    exposure: Annotated[float, _shown(Lighting, "exposure")] = Lighting.exposure
    tone_map: Annotated[ToneMap, _shown(Lighting, "tone_map")] = Lighting.tone_map
    error_by_map: Switch = False
    """Measure the error that each decoded map alone makes in the picture: stats.json, error.MAP.png. Needs another view than base."""
    aovs: Switch = False
    """Write aovs.exr: the maps of the visible surfaces as float channels, with --view lit also normals."""
    require_gpu: Switch = False
    """Fail if the renderer is a software rasteriser."""
    device: Gpu = None


@dataclass(frozen=True)
class EncodeOptions:
    """Encode the textures of a scene or of a folder of images into a pack, or by jobs into a library (docs/guide/many-textures.md)."""

    source: Annotated[Path, tyro.conf.arg(metavar="SCENE|FOLDER|LIST"), tyro.conf.Positional]
    """Textures to encode: a scene, a folder of images (sub-folders become categories), or a .txt file with one image path per line."""
    out: Annotated[Path, in_words("F.ntc|LIBRARY")] = Path()
    """Pack to write, or folder of a library to add to by jobs. Default: SCENE.GROUPING.ntc beside the scene or folder."""
    workers: Annotated[int | None, in_words("N")] = None
    """Processes that encode by jobs, one thread each. The bytes are the same with any number.
    Default: no jobs; one per core for a library."""
    ray: Annotated[str | None, in_words("ADDRESS|auto")] = None
    """Ray cluster that encodes by jobs (extra `ray`). auto: the cluster of this machine. Default: no cluster."""
    gpus_per_job: float = 0.0
    """Share of a GPU that each job of --ray takes. Example: with 0.25, four jobs share one GPU (with --device cuda)."""
    decoders: Annotated[Path | None, in_words("F.ntc")] = None
    """Pack of codec block whose decoders encode the textures, unchanged. It also sets bits, maps and grouping.
    Default: new decoders."""
    grouping: Annotated[GroupingName, _shown(TrainingSettings, "strategy", "See docs/reference/groupings.md.")] = (
        TrainingSettings.strategy
    )
    clusters: Annotated[
        int | None,
        _shown(TrainingSettings, "clusters", "Default: 10, at most one per texture; 16 under universal.", "N"),
    ] = None
    features: FeatureName = GroupingConfig.features
    """Image features by which clustered and covisible compare textures."""
    clip_weights: Annotated[str | None, in_words("FILE|download")] = None
    """Weights for --features clip: a file, or `download` to fetch them. Default: none."""
    labels: Annotated[Path | None, in_words("FILE.csv")] = None
    """CSV with the columns texture and category, for grouping category. Default: the labels of the file, else guesses from names."""
    views: Annotated[
        Path | None,
        _cameras(
            "Example: a recorded path. covisible reduces divergence in these views; --size gives more bits to textures that they "
            "show larger. Default: the scene's cameras for covisible, none for --size."
        ),
    ] = None
    sampled_views: Annotated[int | None, in_words("N")] = None
    """Number of further viewpoints that covisible samples in the scene, 0 to 1000. Default: 24 if the scene has no cameras, else 0."""
    spread_weight: float = GroupingConfig.spread_weight
    """Weight that covisible gives to similar textures in a group, against divergence."""
    largest_share: float = GroupingConfig.largest_share
    """Largest share of the textures in one group of covisible, 0 to 1."""
    codec: Annotated[
        CodecName | None,
        _shown(
            TrainingSettings,
            "codec",
            "Default: block; grid for --recipe paper and with --steps, --epochs, --state or --device cuda.",
            "block|grid",
        ),
    ] = None
    bits: Annotated[float | None, _target("bits", "X", "Default: 4 for whole materials, else 2.")] = None
    quality: Annotated[
        Quality,
        _target("dB", "DB|Xjod", "As in 9.5jod: the least ColorVideoVDP of lit views, up to 10 (extra `perceptual`)."),
    ] = None
    size: Annotated[float | None, _target("MB", "MB")] = None
    preset: Annotated[PresetName | None, in_words("1bit|2bit|4bit|8bit|fast")] = None
    """Target of codec block by name.
    1bit to 8bit set --bits; fast decodes with at most 100 multiply-adds per texel, at about 2 bits."""
    maps: Annotated[
        MapChoice | None,
        _shown(TrainingSettings, "maps", "Default: all for codec block, base for codec grid.", "all|base"),
    ] = None
    map_weights: MapWeightsName = "seen"
    """Weights of errors in the maps of a material. seen: by how much they change the lit picture. equal: the same for all maps."""
    recipe: Annotated[RecipeName, _shown(TrainingSettings, "recipe")] = TrainingSettings.recipe
    texture_size: Annotated[int | None, _shown(TrainingSettings, "texture_size", "Default: full size.", "N")] = None
    steps: Annotated[int | None, in_words("N")] = None
    """Length of training in optimisation steps. Default: the recipe's."""
    epochs: Annotated[float | None, in_words("X")] = None
    """Length of training in epochs: one epoch is one sample of every texel. Excludes --steps. Default: the recipe's."""
    levels: Annotated[int | None, in_words("N")] = None
    """Number of mips to encode, 1 to 16. 1: mip 0 alone, as in the paper. Default: all."""
    seed: int = 0
    """Seed of initialisation, sampling and grouping."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Device that trains. auto takes CUDA if torch has it."""
    state: Annotated[Path | None, in_words("FILE")] = None
    """File for the state of the training: after Ctrl-C the same command resumes. It is removed at the end. Default: none."""

    def grouping_config(self) -> GroupingConfig:
        """Return the options of the grouping."""
        return GroupingConfig(
            name=self.grouping,
            clusters=self.clusters,
            features=self.features,
            spread_weight=self.spread_weight,
            largest_share=self.largest_share,
            seed=self.seed,
        )


@dataclass(frozen=True)
class DecodeOptions:
    """Decode every texture of a pack to a PNG, named as in the pack."""

    pack: Annotated[Path, tyro.conf.arg(metavar="F.ntc"), tyro.conf.Positional]
    """Pack to decode."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Folder for the images."""
    backend: Literal["numpy", "torch", "gl"] = "numpy"
    """Decoder. numpy: the float64 reference. torch: float32 for codec grid, numpy's result for codec block. gl: GLSL on a
    GPU."""
    precision: Annotated[Precision, _shown(Slot, "precision", "For --backend gl.")] = "fp32"
    level: int = 0
    """Mip to decode, from 0. A texture with fewer mips is decoded at its last one."""
    device: Gpu = None


@dataclass(frozen=True)
class ExportOptions:
    """Write a scene and its pack for other programs (docs/guide/export.md)."""

    scene: OptionalScene = None
    """Scene to export, or `gallery`, the built-in spheres. Default: the built-in courtyard."""
    pack: Packs = ()
    """Pack that holds the scene's textures; several with --web. Default: the pack beside the scene, clustered before others."""
    out: Annotated[Path | None, in_words("G.gltf|G.glb|DIR")] = None
    """glTF file to write: a copy of the scene whose textures also name the pack (NV_texture_swizzle). With --shader: a folder."""
    web: Annotated[Path | None, in_words("DIR")] = None
    """Folder to write a web page into, which shows the packs in the browser.
    With --fallback none it holds no originals to compare with."""
    shader: Annotated[ShaderLanguage | None, in_words("glsl|hlsl|wgsl|cuda")] = None
    """Language of the pack's decoder, written as source into the folder --out with its data, a C header and a C++ program."""
    image_format: Annotated[
        ImageFormat | None, tyro.conf.arg(name="as", metavar="png|ktx2|bc7|bc1|astc", help_behavior_hint="")
    ] = None
    """Format of decoded images, written in place of the pack.
    Without mips: png. With mips: ktx2 (Basis UASTC), bc7 and bc1 (DDS), astc (6x6 in KTX2, EXT_texture_astc)."""
    fallback: Fallback = "original"
    """Images for programs that do not read packs: the scene's images, the same as JPEG or KTX2 (Basis Universal), or none."""


LibraryAction = Literal["add", "list", "verify", "extract"]


@dataclass(frozen=True)
class LibraryOptions:
    """Manage a library: a folder with packs of many scenes (docs/guide/many-textures.md)."""

    action: Annotated[LibraryAction, tyro.conf.Positional]
    """Action. add: add packs. list: list the textures. verify: check every byte. extract: write one pack."""
    folder: Annotated[Path, tyro.conf.arg(metavar="LIBRARY"), tyro.conf.Positional]
    """Folder of the library. `add` makes a new one."""
    files: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="F.ntc|SCENE"), tyro.conf.Positional] = ()
    """Packs to add; scene whose textures to extract. Default of extract: all textures."""
    out: Annotated[Path | None, in_words("F.ntc")] = None
    """Pack that extract writes."""
    json: Switch = False
    """Let list print JSON instead of a table."""


@dataclass(frozen=True)
class InfoOptions:
    """Print the contents of a scene, a pack or a folder: what is drawn, and what is ignored."""

    file: Annotated[Path | None, in_words("SCENE|F.ntc"), tyro.conf.Positional] = None
    """Scene, pack or library."""
    all: Annotated[Path | None, in_words("DIR")] = None
    """Folder to list in place of one file: every .gltf, .glb and .ntc below it, refused ones included."""
    json: Switch = False
    """Print JSON instead of text."""


@dataclass(frozen=True)
class CheckOptions:
    """Check an encoded scene, pack or library against a budget: exit status 1 where a limit is exceeded (docs/guide/check.md)."""

    source: Annotated[Path | None, in_words("SCENE|F.ntc|LIBRARY"), tyro.conf.Positional] = None
    """Scene with its pack: textures and lit views are measured. For a pack or library alone, the encoder's values are checked.
    Default: the built-in courtyard."""
    pack: Packs = ()
    """Pack of the scene to check. Default: the pack beside the scene, clustered before others."""
    grouping: Annotated[str | None, in_words("NAME")] = None
    """Grouping to check where the scene has several packs."""
    budget: Annotated[Path | None, in_words("FILE.toml")] = None
    """Budget: limits of the measured values. Default: none."""
    against: Annotated[Path | None, in_words("REPORT.json")] = None
    """Accepted report: values that are worse than in it fail the check. Default: none."""
    out: Annotated[Path | None, in_words("DIR")] = None
    """Folder for report.json, junit.xml, check.sarif and the page index.html. Default: the table on the terminal alone."""
    suggest: Annotated[Path | None, in_words("FILE.toml")] = None
    """Budget to write: limits that the measured values meet with a margin of 2 %."""
    views: Annotated[int, tyro.conf.arg(metavar="N")] = 2
    """Number of cameras whose lit pictures are measured, each in two lights. 0: only textures are measured."""
    close: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Number of further views at 0.8 to 4 eye heights from a surface, found in the scene; none with --views 0."""
    cameras: Annotated[Path | None, _cameras("Default: the scene's; without any, one that frames the scene.")] = None
    size: Size = (640, 360)
    """Size of the pictures in pixels."""
    device: Gpu = None


@dataclass(frozen=True)
class ShareOptions:
    """Compare groupings of a scene: what sharing decoders costs in dB, and saves in divergence, bytes and milliseconds.

    Groupings are trained in turns, with equal steps, samples and bits. Writes share.json, share.csv, share.png and the packs.
    """

    scene: Annotated[Path, tyro.conf.arg(metavar="SCENE|FOLDER"), tyro.conf.Positional]
    """Scene, or folder of images, whose textures are encoded."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Folder for the results. After Ctrl-C it holds the state of all trainings, and the same command resumes."""
    codec: Annotated[CodecName, _shown(TrainingSettings, "codec")] = SharingSettings.codec
    groupings: tuple[GroupingName, ...] = SharingSettings.groupings
    """Groupings to compare. baseline: a decoder per texture. single: one decoder for all."""
    clusters: Annotated[tuple[int, ...], in_words("K ...")] = SharingSettings.clusters
    """Numbers of groups of clustered, covisible and random. Default: a quarter of the textures. Example: --clusters 2 4 8."""
    steps: int = SharingSettings.steps
    """Training steps of each grouping, for codec grid."""
    bits: Annotated[float | None, in_words("B")] = None
    """Bits per texel of the codes of codec block. Default: 4 for whole materials, else 2."""
    texture_size: Annotated[int | None, _shown(TrainingSettings, "texture_size", "Default: full size.", "N")] = None
    seed: tuple[int, ...] = SharingSettings.seeds
    """Seeds of the trainings: with several, the spread of each grouping is shown."""
    views: Annotated[Path | None, _cameras("Default: the scene's cameras, else sampled viewpoints.")] = None
    size: Size = (640, 360)
    """Size in pixels of the picture that decode paths are timed on."""
    device: DeviceName = SharingSettings.device
    """Device that trains. auto takes CUDA if torch has it."""
    gpu: Gpu = None

    def settings(self) -> SharingSettings:
        """Return the settings of the comparison. Raises InputError."""
        return SharingSettings(
            codec=self.codec,
            groupings=self.groupings,
            clusters=self.clusters,
            steps=self.steps,
            bits=self.bits,
            seeds=self.seed,
            device=self.device,
        )


@dataclass(frozen=True)
class DoctorOptions:
    """Check this machine: OpenGL, display, packages. Exit status 0 if pictures can be drawn."""

    json: Switch = False
    """Print JSON instead of text."""
    device: Gpu = None


SUBCOMMANDS = (
    Subcommand("view", ViewOptions, "viewer.cli.view", "view"),
    Subcommand("render", RenderOptions, "viewer.cli.render", "render"),
    Subcommand("encode", EncodeOptions, "viewer.cli.encode", "encode"),
    Subcommand("decode", DecodeOptions, "viewer.cli.decode", "decode"),
    Subcommand("export", ExportOptions, "viewer.cli.export", "export"),
    Subcommand("library", LibraryOptions, "viewer.cli.library", "library"),
    Subcommand("info", InfoOptions, "viewer.cli.info", "info"),
    Subcommand("check", CheckOptions, "viewer.cli.check", "check"),
    Subcommand("share", ShareOptions, "viewer.cli.share", "share"),
    Subcommand("doctor", DoctorOptions, "viewer.cli.doctor", "doctor"),
)
