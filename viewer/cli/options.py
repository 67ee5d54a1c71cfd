"""Every subcommand and its options, frozen dataclasses that tyro turns into the command line (see README)."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from ntc.codec.config import FeatureName, GroupingConfig, GroupingName, PrecisionChoice
from ntc.codec.encoding import PresetName, RecipeName
from ntc.codec.maps import MapWeightsName
from ntc.codec.registry import SUMMARIES, CodecName
from viewer.export import Fallback, ImageFormat, ShaderLanguage
from viewer.scene.source_textures import MapChoice
from viewer.state.settings import Anisotropy
from viewer.state.view_state import (
    BlockName,
    Lighting,
    MaterialView,
    Overlay,
    PaletteName,
    PathChoice,
    Precision,
    ScaleName,
    TexelFilter,
    ToneMap,
)

CODEC_HELP = " ".join(
    [
        *(f"{name}: {summary}" for name, summary in SUMMARIES.items()),
        "None: block for recipe best, grid for paper and where --steps, --epochs, --state or --device cuda ask for training.",
    ]
)
LARGEST_SIDE = 16384
"""Pixels: the largest picture side that any option accepts."""


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
OptionalScene = Annotated[Path | None, tyro.conf.arg(metavar="SCENE"), tyro.conf.Positional]


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
Packs = Annotated[tuple[Path, ...], tyro.conf.arg(metavar="F.ntc ...")]
Lines = Annotated[tuple[str, ...], tyro.conf.arg(metavar="'LINE; LINE'"), tyro.conf.UseAppendAction]
Switch = tyro.conf.FlagCreatePairsOff[bool]
Gpu = Annotated[str | None, tyro.conf.arg(metavar="N|NAME")]
"""GPU as `viewer.gl.devices.choose_device` takes it; None: the one that NTC_VIEWER_DEVICE names, else the first one."""


@dataclass(frozen=True)
class Subcommand:
    """Subcommand of `ntc-viewer`, or one study of `ntc-viewer study`."""

    name: str
    options: type[Any]
    """Dataclass whose fields are the options and whose docstring is the summary in --help."""
    module: str
    """Imported only when the command runs: most commands need neither torch nor OpenGL."""
    function: str
    """Name of the function in `module` that takes an instance of `options`, returns the exit status and raises InputError."""


@dataclass(frozen=True, kw_only=True)
class DecoderOptions:
    """Options of decoding that change speed and no picture."""

    decoder_variant: str = ""
    """How decoders are laid out on the GPU: default, measured, or settings such as pixels=2,unrolled=16,weights=shared. Empty:
    NTC_VIEWER_DECODER_VARIANT, else what a GPU has measured, and the default of a software renderer. No picture depends on it."""


@dataclass(frozen=True)
class ViewOptions(DecoderOptions):
    """Open a scene in a window. Without a display, pictures are written to a folder instead."""

    scene: OptionalScene = None
    """glTF scene (.gltf, .glb, or a mesh format that trimesh reads). `gallery`: the built-in spheres. None: the built-in courtyard."""
    pack: Packs = ()
    """Packs to open besides those found beside the scene (NAME.*.ntc)."""
    grouping: str | None = None
    """What slot A shows first: "reference", the grouping of an open pack, or bc1, bc7, astc-4x4 to astc-12x12 (extra `lab`)."""
    path: PathChoice = "deferred"
    """Decode path of slot A; `auto` times all of them first."""
    precision: PrecisionChoice = "fp32"
    """Storage of decoder weights on the GPU, and arithmetic with them; `auto` takes half precision where it is not visible."""
    filter: TexelFilter | None = None
    """Filter of slot A, but for path cached: exact, or stochastic, one texel at random, accumulated at rest. None: as it was last."""
    script: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Play the commands of this file (docs/guide/scripts.md); then the window stays open."""
    exec: Lines = ()
    """Play these commands after the script's; may be repeated."""
    headless: Switch = False
    """Open no window: play the script, or write one picture."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("ntc-viewer-pictures")
    """Folder for pictures, views and recorded paths."""
    size: Size | None = None
    """Size of the window's content. None: as it was last; 1280x720 without a window."""
    device: Gpu = None
    """Without a window: the GPU, by its number or part of its name (ntc-viewer doctor lists them), or `software`. None: the first."""


@dataclass(frozen=True)
class RenderOptions(DecoderOptions):
    """Draw one picture without a window and write it, ids, divergence and statistics into a folder."""

    out: Path
    """Folder for color.png, texture_id.npy, decoder_id.npy, divergence.npy, stats.json."""
    scene: OptionalScene = None
    """glTF scene. `gallery`: the built-in spheres. None: the built-in courtyard."""
    variant: str = ""
    """Name of the material variant to draw (KHR_materials_variants). Empty: the materials that the scene's parts name themselves."""
    time: float | None = None
    """Seconds from an animation's beginning at which the scene stands. None: as its nodes say, without an animation."""
    animation: str = ""
    """--time: name of the animation. Empty: the first one of the file."""
    pack: Packs = ()
    """Packs to choose from besides those found beside the scene (NAME.*.ntc)."""
    grouping: str | None = None
    """"reference" (original images), the grouping of a pack, or a format of graphics hardware: bc1, bc7, astc-4x4 to
    astc-12x12 (extra `lab`). None: clustered, else the first pack, else reference."""
    path: PathChoice = "deferred"
    """Decode path; `auto` times all of them first."""
    precision: PrecisionChoice = "fp32"
    """Storage of decoder weights on the GPU, and arithmetic with them; `auto` takes half precision where it is not visible."""
    filter: TexelFilter = "exact"
    """Filter of all paths but cached: exact, or stochastic, one texel at random, the mean of 16 samples."""
    size: Size = (1280, 720)
    """Picture size in pixels."""
    cameras: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """JSON file of named cameras; None: the scene's own."""
    camera: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Name of the camera to use; None: the first one, or the whole scene framed."""
    eye: Vector = None
    """Viewpoint, in scene units, Y up (with --target)."""
    target: Vector = None
    """Point to look at."""
    fov: float = 60.0
    """Vertical field of view of --eye/--target, degrees."""
    overlay: Literal["none", "divergence", "error"] = "none"
    """Also write overlay.png: decoders per block, or error against the reference."""
    opacity: float = 0.6
    """Opacity of the divergence overlay, 0 to 1."""
    palette: PaletteName = "green-red"
    """Colours of the divergence overlay; viridis is fit for the colour-blind."""
    block: BlockName = Overlay.block
    """Blocks in which decoders are counted, WIDTHxHEIGHT in pixels."""
    scale: ScaleName = "picture"
    """Most decoders of the divergence overlay's colours: those of the picture, or as in the window a number for each block shape."""
    anisotropy: Anisotropy = 1
    """Anisotropic filtering of images and of path `cached`; 1 is trilinear, as the other paths filter."""
    view: MaterialView = "base"
    """What of the materials is shown: surfaces in the light, or one of their maps (orm: occlusion, roughness, metalness)."""
    environment: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """--view lit: equirectangular panorama (.hdr or .exr) that lights the scene. None: the sky that the sun makes."""
    sun: Annotated[tuple[float, float], tyro.conf.arg(metavar="AZIMUTH ELEVATION")] = (
        Lighting.sun_azimuth,
        Lighting.sun_elevation,
    )
    """--view lit: where the sun stands, in degrees from north (-Z) towards east (+X), and above the horizon."""
    sun_strength: float | None = None
    """--view lit: times the sun's own strength; 0 leaves it out. None: 1 in the sky, 0 with a panorama: it has lights of its own."""
    exposure: float = Lighting.exposure
    """--view lit: in stops; 1 is twice as bright."""
    tone_map: ToneMap = Lighting.tone_map
    """--view lit: Khronos PBR Neutral, AgX, or clipping alone."""
    error_by_map: Switch = False
    """Also say in stats.json what the error of each decoded map alone does to the picture, and write it as error.MAP.png. Not with
    --view base."""
    aovs: Switch = False
    """Also write aovs.exr: the maps of the visible surfaces, and with --view lit normals, as channels of floats."""
    require_gpu: Switch = False
    """Fail if the renderer is a software rasteriser."""
    device: Gpu = None
    """The GPU, by its number or part of its name (ntc-viewer doctor lists them), or `software`. None: the first."""


@dataclass(frozen=True)
class EncodeOptions:
    """Encode the textures of a scene or of a folder of images: as one pack, or by jobs as a library (docs/guide/many-textures.md)."""

    source: Annotated[Path, tyro.conf.arg(metavar="SCENE|FOLDER|LIST"), tyro.conf.Positional]
    """glTF scene, a folder of images (sub-folder names become categories), or a text file (.txt) with the path of an image a line."""
    out: Annotated[Path, tyro.conf.arg(metavar="F.ntc|LIBRARY")]
    """The pack to write, or the folder of a library to add to, by jobs."""
    workers: int | None = None
    """Encode by jobs in so many processes, one thread each; the bytes are the same with any number. None: in this process; for a
    library as many as there are cores."""
    ray: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS|auto")] = None
    """Encode by jobs on this Ray cluster (extra `ray`); auto: the one that runs on this machine."""
    gpus_per_job: float = 0.0
    """--ray: share of a GPU that a job takes, e.g. 0.25: four jobs share one (with --device cuda)."""
    report: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """By jobs: folder for a page with figures, a plot and the worst textures. None: beside --out, its name with .report."""
    grouping: GroupingName = "clustered"
    """Which textures share a decoder."""
    clusters: int | None = None
    """Number of decoders of clustered, random and covisible. None: 10, or one for each texture where there are fewer."""
    features: FeatureName = GroupingConfig.features
    """Features by which clustered and covisible compare textures."""
    clip_weights: Annotated[str | None, tyro.conf.arg(metavar="FILE|download")] = None
    """Weights of --features clip: a file, or "download" to fetch them."""
    labels: Annotated[Path | None, tyro.conf.arg(metavar="FILE.csv")] = None
    """CSV with the columns texture and category, for category. None: labels of the file, else guessed from names."""
    views: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """JSON file of cameras, e.g. a recorded path, for which covisible reduces divergence and --size shares out bits. None: covisible
    takes the scene's own cameras."""
    sampled_views: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Viewpoints sampled in the scene that covisible uses besides. None: 24 where there are no cameras."""
    spread_weight: float = GroupingConfig.spread_weight
    """covisible: weight of the likeness of textures in a group, against divergence."""
    largest_share: float = GroupingConfig.largest_share
    """covisible: no group holds more than this share of the textures."""
    codec: Annotated[CodecName | None, tyro.conf.arg(help=CODEC_HELP)] = None
    bits: float | None = None
    """Codec block: bits per texel to come nearest to, all mips and decoders counted. None, and none of the next three: 2."""
    quality: Annotated[float | None, tyro.conf.arg(metavar="DB")] = None
    """Codec block: PSNR in dB that each texture is to have at least, in as few bits as possible."""
    size: Annotated[float | None, tyro.conf.arg(metavar="MB")] = None
    """Codec block: megabytes of 10^6 bytes that the file may have at most. With --views, textures seen in more pixels get more."""
    preset: PresetName | None = None
    """Codec block: 1bit to 8bit stand for --bits; fast decodes in at most 100 multiply-adds a texel, at about 2 bits."""
    maps: MapChoice | None = None
    """all: whole materials, the maps of each encoded together. base: base colours alone. None: all for codec block, but for grouping
    universal, whose decoder serves base colours alone."""
    map_weights: MapWeightsName = "seen"
    """What errors in the maps of a material are worth: seen, by how much they change the lit picture, or equal."""
    recipe: RecipeName = "best"
    """best: codec block, or with --codec grid the fastest training found to good quality. paper: codec grid with the learning rates,
    batch and freezing of the paper."""
    texture_size: int | None = None
    """Reduce textures to at most this many texels a side before encoding. None: full size."""
    steps: int | None = None
    """Optimisation steps; overrides the recipe's length."""
    epochs: float | None = None
    """Length in epochs: every texel of every texture once. Not together with --steps."""
    levels: int | None = None
    """Latent levels, one per mip; None: the whole pyramid, 1: mip 0 alone as in the paper."""
    seed: int = 0
    """Seed of initialisation, sampling and grouping."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where to train; auto takes CUDA when torch has it."""
    state: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Keep the state of the training in this file: after Ctrl-C the same command resumes it. Removed at the end."""

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
    """The pack."""
    out: Path
    """Folder for the images."""
    backend: Literal["numpy", "torch", "gl"] = "numpy"
    """numpy: float64 reference. torch: float32. gl: the GLSL decoder."""
    precision: Precision = "fp32"
    """Storage of the decoder weights (gl only)."""
    level: int = 0
    """Mip level to decode; textures without it are decoded at their last."""
    device: Gpu = None
    """--backend gl: the GPU, by its number or part of its name (ntc-viewer doctor lists them), or `software`. None: the first."""


@dataclass(frozen=True)
class ExportOptions:
    """Write a scene and its pack for other programs (docs/guide/export.md)."""

    scene: OptionalScene = None
    """glTF scene (.gltf, .glb, or a mesh format that trimesh reads). None: the built-in courtyard."""
    pack: Packs = ()
    """The pack that holds the scene's textures. None: one that lies beside the scene, clustered before others."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="G.gltf|G.glb|DIR")] = None
    """The glTF file to write: a copy of the scene whose textures also name the pack (NV_texture_swizzle). With --shader: a
    folder."""
    web: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Instead of a glTF file, write a folder with a page that decodes the pack in the browser. Originals to compare with: not with
    --fallback none."""
    shader: ShaderLanguage | None = None
    """Instead of a scene, write the pack's decoder as source for other programs into the folder --out, with its data, their layout as
    a header of C, and a program in C++ that decodes texels."""
    image_format: Annotated[ImageFormat | None, tyro.conf.arg(name="as")] = None
    """Instead of naming the pack, write what it decodes to: png; with mips ktx2 (Basis UASTC), bc7 and bc1 (DDS), astc (6x6, KTX2)."""
    fallback: Fallback = "original"
    """Images for programs that do not read packs: the scene's own, the same as JPEG or KTX2 (Basis Universal), or none, as far as
    the pack holds them whole."""


LibraryAction = Literal["add", "assign", "list", "verify", "compact", "extract"]


@dataclass(frozen=True)
class LibraryOptions:
    """Look after a library: a folder of encoded textures of many scenes (docs/guide/many-textures.md)."""

    action: Annotated[LibraryAction, tyro.conf.Positional]
    """add packs to it; assign: encode what it lacks of a scene or a folder of images with decoders that it has, and tell what that
    loses; list its textures; verify every byte; compact: join small shards, leave damaged ones out; extract a pack."""
    folder: Annotated[Path, tyro.conf.arg(metavar="LIBRARY"), tyro.conf.Positional]
    """The library's folder; `add` makes one."""
    files: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="F.ntc|SCENE"), tyro.conf.Positional] = ()
    """add: the packs. assign: one scene or folder. extract: the scene whose textures are wanted; none: all textures."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="F.ntc")] = None
    """extract: the pack to write."""
    json: Switch = False
    """list: print JSON instead of a table."""


@dataclass(frozen=True)
class InfoOptions:
    """Print what a scene, a pack or all of a folder contains, what of it is honoured and what is ignored."""

    file: Annotated[Path | None, tyro.conf.arg(metavar="SCENE|F.ntc"), tyro.conf.Positional] = None
    """The file."""
    all: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Instead of one file: a table of every .gltf, .glb and .ntc below this folder, those that are refused included."""
    json: Switch = False
    """Print JSON instead of text."""


@dataclass(frozen=True)
class DoctorOptions:
    """Check this machine: OpenGL, display, packages. Exit status 0 if pictures can be drawn."""

    json: Switch = False
    """Print JSON instead of text."""
    device: Gpu = None
    """The GPU to tell more of, by its number or part of its name, or `software`. None: the first."""


SUBCOMMANDS = (
    Subcommand("view", ViewOptions, "viewer.cli.view", "view"),
    Subcommand("render", RenderOptions, "viewer.cli.render", "render"),
    Subcommand("encode", EncodeOptions, "viewer.cli.encode", "encode"),
    Subcommand("decode", DecodeOptions, "viewer.cli.decode", "decode"),
    Subcommand("export", ExportOptions, "viewer.cli.export", "export"),
    Subcommand("library", LibraryOptions, "viewer.cli.library", "library"),
    Subcommand("info", InfoOptions, "viewer.cli.info", "info"),
    Subcommand("doctor", DoctorOptions, "viewer.cli.doctor", "doctor"),
)
