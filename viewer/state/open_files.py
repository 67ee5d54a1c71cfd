"""Opening scenes and packs, for a new session and in one that is open."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ntc.codec.config import PrecisionChoice
from ntc.codec.gpu import VariantName
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.metrics.block_compression import named_format
from ntc.pack.match import PackMatch, require_match
from viewer.locations import is_builtin
from viewer.scene.cameras_file import with_cameras_beside
from viewer.scene.images import ProgressReport
from viewer.scene.json_text import counted
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.event_handlers import notify
from viewer.state.framing import frame_all
from viewer.state.message_log import details_of
from viewer.state.pack_files import (
    match_scene,
    packs_of,
    preferred_source,
    read_packs,
    same_place,
    source_of_grouping,
    unused_name,
    wanted_textures,
)
from viewer.state.session import InspectionState, Session, WindowState
from viewer.state.settings import ViewerSettings, with_recent
from viewer.state.view_state import (
    DEFAULT_LIGHTING,
    REFERENCE,
    Lighting,
    MaterialView,
    PathChoice,
    Slot,
    TexelFilter,
    ViewState,
)


@dataclass(frozen=True)
class InitialView:
    """Choices for the view that a scene opens with."""

    grouping: str | None = None
    """Source of slot A: REFERENCE, the grouping of an open pack, or a block format. None: the clustered pack, else the first
    pack, else the reference."""
    path: PathChoice = "deferred"
    precision: PrecisionChoice = "fp32"
    """Precision of slot A; `auto` begins with fp32 and measures."""
    filter: TexelFilter | None = None
    """Texel filter of slot A; None takes the one of the settings."""
    material_view: MaterialView = "lit"
    lighting: Lighting = DEFAULT_LIGHTING
    decoder_variant: VariantName | None = None
    """Layout of the decoding shaders; None: that of the renderer."""


def new_session(
    scene: Scene, packs: Mapping[str, Pack], settings: ViewerSettings, initial: InitialView, pictures: Path = Path()
) -> Session:
    """Make a session with `scene`; `pictures` is the folder for pictures, views and camera paths.

    Cameras of a file beside the scene are added to its own. A file that cannot be read becomes a message.
    """
    scene, problem = _with_cameras(scene)
    session = Session(scene, dict(packs), _initial_view(scene, packs, settings, initial), settings, pictures)
    session.decoder_variant = initial.decoder_variant
    session.window = WindowState(show_panels=settings.show_panels, picture_size=settings.window_size)
    session.precision_searches = frozenset(("a",) if initial.precision == "auto" else ())
    block_format = named_format(initial.grouping)
    if block_format is not None:
        session.awaited_formats = {"a": block_format}
    session.seeks_first_view = not scene.cameras
    _begin(session, () if problem is None else (problem,))
    return session


def _with_cameras(scene: Scene) -> tuple[Scene, InputError | None]:
    try:
        return with_cameras_beside(scene), None
    except InputError as error:
        return scene, error


def _begin(session: Session, problems: Sequence[InputError]) -> None:
    """Report the problems of reading the scene, and put it first in the list of recent files."""
    for problem in problems:
        notify(session, str(problem), "error", details_of(problem))
    if session.scene.path is not None and not is_builtin(session.scene.path):
        session.settings = with_recent(session.settings, session.scene.path)


def _initial_view(scene: Scene, packs: Mapping[str, Pack], settings: ViewerSettings, initial: InitialView) -> ViewState:
    wanted = initial.grouping
    source_of_wanted = source_of_grouping(packs, wanted) if wanted is not None else None
    last = settings.last_packs.get(str(scene.path.absolute()), "") if scene.path is not None else ""
    source = REFERENCE if wanted == REFERENCE else source_of_wanted or preferred_source(packs, last)
    precision = "fp32" if initial.precision == "auto" else initial.precision
    width, height = settings.window_size
    return ViewState(
        camera=scene.cameras[0] if scene.cameras else frame_all(scene, settings.fov_degrees, width / height),
        size=settings.window_size,
        slot_a=Slot(source, initial.path, precision, initial.filter or settings.texel_filter),
        slot_b=Slot(REFERENCE),
        compare="a" if source == REFERENCE else "wipe",
        wipe_position=settings.wipe_position,
        overlay=replace(settings.overlay, kind="none"),
        anisotropy=settings.anisotropy,
        material_view=initial.material_view,
        lighting=initial.lighting,
    )


@dataclass(frozen=True, eq=False)
class ReadScene:
    """Scene with the packs and cameras beside it, as read from files."""

    scene: Scene
    packs: Mapping[str, Pack]
    problems: tuple[InputError, ...]
    """Errors of packs and cameras beside the scene."""


def read_scene(path: Path, report: ProgressReport | None = None) -> ReadScene:
    """Read the scene at `path`, or the one in a folder, with the packs and cameras beside it. Raises InputError."""
    try:
        scene, problem = _with_cameras(load_scene(path, report=report))
        packs: dict[str, Pack] = {}
        problems: list[InputError] = []
        for pack_path in packs_of(scene):
            try:
                pack, _ = _matching_pack(pack_path, scene)
                packs[unused_name(pack.grouping.name, pack_path, packs)] = pack
            except InputError as error:
                # The scene opens without a pack that cannot be read or is of another scene.
                problems.append(error)
    except (OSError, ValueError) as error:
        # Names that no file can have, and failures that reading does not expect.
        raise _cannot_open(path, error) from error
    return ReadScene(scene, packs, (*problems, *([problem] if problem is not None else [])))


def _cannot_open(path: Path, error: Exception) -> InputError:
    return InputError(f"{path}: cannot be opened ({error}); check the path")


def open_scene(session: Session, read: ReadScene) -> None:
    """Replace the open scene by another one."""
    session.settings = session.present_settings
    scene = session.scene = read.scene
    session.packs, session.compressed, session.previous_views = read.packs, {}, {}
    before = InitialView(material_view=session.view.material_view, lighting=session.view.lighting)
    session.view = _initial_view(scene, read.packs, session.settings, before)
    session.navigation.motion, session.playback = None, replace(session.playback, is_playing=False)
    session.precision_searches, session.awaited_formats, session.seeks_first_view = frozenset(), {}, not scene.cameras
    session.inspection = InspectionState(errors=session.inspection.errors)
    session.window.file_dialog = False
    _begin(session, read.problems)
    missing = len(scene.report.missing)
    note = f"; {counted(missing, 'missing file')}, see panel Scene" if missing else ""
    notify(session, f"opened {scene.path.name if scene.path is not None else scene.name}{note}")


def read_variant(scene: Scene, variant: str, report: ProgressReport | None = None) -> Scene:
    """Read `scene` again, in another material variant. Raises InputError."""
    if scene.path is None or variant == scene.variant:
        return scene
    return replace(load_scene(scene.path, variant, scene.pose, report, scene), cameras=scene.cameras)


def show_variant(session: Session, scene: Scene) -> None:
    """Show the scene as read in another material variant; packs and view stay."""
    if scene is not session.scene:
        session.scene, variant = scene, scene.variant
        named = f"material variant {variant}" if variant else "the scene's own materials"
        notify(session, named)


def open_pack(session: Session, path: Path) -> None:
    """Open a pack or library with textures of the open scene in slot A. Raises InputError, and then changes nothing."""
    try:
        pack, match = _matching_pack(path, session.scene)
    except (OSError, ValueError) as error:
        raise _cannot_open(path, error) from error
    same = (name for name, other in session.packs.items() if other.path is not None and same_place(other.path, path))
    name = next(same, None) or unused_name(pack.grouping.name, path, session.packs)
    session.packs = {**session.packs, name: pack}
    session.settings = with_recent(session.settings, path)
    session.view = session.view.with_source("a", name)
    notify(session, f"opened {path.name} in slot A: {match.line()}")


def _matching_pack(path: Path, scene: Scene) -> tuple[Pack, PackMatch]:
    """Read a pack with textures of `scene`; of a library the fullest one. Raises InputError for a pack of another scene."""
    packs = read_packs(path, wanted_textures(scene))
    if not packs:
        raise InputError(f"{path}: the library holds no texture of {scene.name}; encode the scene with --out {path}")
    pack = packs[0]
    match = match_scene(pack, scene)
    require_match(pack, match, scene.name)
    return pack, match
