"""`ntc-viewer export`: writes a scene and its pack for other programs."""

import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from ntc.errors import InputError
from viewer.app.export_files import export_files
from viewer.cli.options import ExportOptions
from viewer.cli.progress import TerminalProgress
from viewer.export import ExportRequest
from viewer.locations import builtin_scene_path, named_scene
from viewer.scene.scene_files import PACK_SUFFIX, scene_file
from viewer.state.pack_files import PREFERRED_GROUPING, packs_beside


def _packs(options: ExportOptions, scene: Path) -> tuple[Path, ...]:
    """Return the packs that the options name, else the one beside the scene. Raises InputError for none, and for several without
    --web."""
    if len(options.pack) > 1 and options.web is None:
        raise InputError(
            f"--pack {' '.join(map(str, options.pack))}: one pack is exported with a scene, several with --web; name one"
        )
    beside = packs_beside(scene)
    preferred = [path for path in beside if path.name.endswith(f".{PREFERRED_GROUPING}{PACK_SUFFIX}")]
    packs = tuple(options.pack or preferred[:1] or beside[:1])
    if not packs:
        raise InputError(
            f"{scene}: no pack lies beside it; name one by --pack F.ntc, or make one: "
            f"ntc-viewer encode {scene} --grouping clustered --out {scene.stem}.clustered.ntc"
        )
    return packs


def export(options: ExportOptions) -> int:
    """Run `ntc-viewer export`. Raises InputError for bad input."""
    if (options.out is None) == (options.web is None):
        raise InputError(
            "export: name what to write: --out G.gltf, --out G.glb, --web DIR, or --shader LANGUAGE --out DIR"
        )
    if options.shader is not None and (options.out is None or options.image_format is not None):
        raise InputError(f"--shader {options.shader}: is written into the folder --out, without --web and --as")
    scene = scene_file(named_scene(options.scene) if options.scene is not None else builtin_scene_path())
    packs = _packs(options, scene)
    if options.web is not None and options.image_format is not None:
        raise InputError(f"--as {options.image_format}: a page decodes by itself; leave it out, or write a glTF file")
    is_page = options.web is not None
    out = options.web or options.out
    assert out is not None
    request = ExportRequest(scene, packs, out, is_page, options.shader, options.image_format, options.fallback)
    with _progress(request) as report:
        lines = export_files(request, report)
    sys.stdout.write("\n".join(lines) + "\n")
    return 0


def _progress(request: ExportRequest) -> AbstractContextManager[TerminalProgress | None]:
    """Return a progress bar for exports that may take long; for others, a context that does nothing."""
    if request.page:
        return TerminalProgress(f"opening {request.scene.name}", "images")
    return TerminalProgress("images", lines=True) if request.image_format is not None else nullcontext()
