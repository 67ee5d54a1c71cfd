"""`ntc-viewer export`: a scene and its pack for other programs."""

import sys
from pathlib import Path

from ntc.errors import InputError
from viewer.cli.options import ExportOptions
from viewer.export.gltf.export import ExportedScene, export_gltf
from viewer.locations import builtin_scene_path, named_scene
from viewer.scene.scene_files import PACK_SUFFIX, scene_file
from viewer.state.pack_files import PREFERRED_GROUPING, packs_beside


def _pack(options: ExportOptions, scene: Path) -> Path:
    """The pack that is named, else the one that lies beside the scene. Raises InputError for none and for several."""
    if len(options.pack) > 1:
        raise InputError(f"--pack {' '.join(map(str, options.pack))}: one pack is exported with a scene; name one")
    beside = packs_beside(scene)
    preferred = [path for path in beside if path.name.endswith(f".{PREFERRED_GROUPING}{PACK_SUFFIX}")]
    found = options.pack or preferred[:1] or beside[:1]
    if not found:
        raise InputError(
            f"{scene}: no pack lies beside it; name one by --pack F.ntc, or make one: "
            f"ntc-viewer encode {scene} --grouping clustered --out {scene.stem}.clustered.ntc"
        )
    return found[0]


def result_lines(exported: ExportedScene) -> list[str]:
    """What was written, for a person."""
    lines = [f"note: {line}" for line in exported.missing]
    lines.append(
        f"{exported.textures} of {exported.of_textures} textures are in the pack"
        + (f"; {exported.replaced} images replaced or left out" if exported.replaced else "")
    )
    lines.append(f"wrote {exported.out} ({exported.scene_bytes / 1e6:.2f} MB with its files)")
    lines.append(f"wrote {exported.pack} ({exported.pack_bytes / 1e6:.2f} MB)")
    return lines


def export(options: ExportOptions) -> int:
    """Run `ntc-viewer export`. Raises InputError for bad input."""
    if options.out is None:
        raise InputError("export: name what to write: --out G.gltf or --out G.glb")
    scene = scene_file(named_scene(options.scene) if options.scene is not None else builtin_scene_path())
    exported = export_gltf(scene, _pack(options, scene), options.out, options.fallback)
    sys.stdout.write("\n".join(result_lines(exported)) + "\n")
    return 0
