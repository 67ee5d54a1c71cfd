"""What test_addon.py does inside Blender: build a scene, encode it, switch images, export it and open it again.

Arguments behind `--`: folder, command of ntc-viewer. Writes result.json into the folder.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

if not hasattr(np, "bool"):
    # Debian's importer of glTF in Blender 3.4 takes it from a numpy that no longer has it.
    vars(np)["bool"] = bool
SIDE = 64
FOLDER, COMMAND = Path(sys.argv[-2]), sys.argv[-1]


def image(name: str, channels: Sequence[NDArray[Any]], is_data: bool) -> Any:
    """A new image of smooth channels in [0, 1]."""
    made = bpy.data.images.new(name, SIDE, SIDE)
    made.colorspace_settings.name = "Non-Color" if is_data else "sRGB"
    values = np.ones((SIDE, SIDE, 4), np.float32)
    for part, channel in enumerate(channels):
        values[..., part] = channel
    made.pixels.foreach_set(values.ravel())
    made.pack()
    return made


def pixels(own: Any) -> NDArray[np.float32]:
    """[SIDE, SIDE, 4] of an image."""
    values = np.empty(own.size[0] * own.size[1] * 4, np.float32)
    own.pixels.foreach_get(values)
    return values.reshape(own.size[1], own.size[0], 4)


def build() -> dict[str, Any]:
    """A plane with base colour, normals, and roughness and metalness in one image."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] / 9.0
    waves = [0.5 + 0.3 * np.sin(x * (k + 1) + y + k) for k in range(4)]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_plane_add(size=2.0)
    material = bpy.data.materials.new("plaster")
    bpy.context.object.data.materials.append(material)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    normals = [0.5 + 0.1 * np.sin(x), 0.5 + 0.1 * np.cos(y), np.full_like(x, 0.97)]
    made = {}
    for name, channels, is_data in (
        ("color", waves[:3], False),
        ("bumps", normals, True),
        ("packed", [np.ones_like(x), waves[1], waves[3]], True),
    ):
        made[name] = nodes.new("ShaderNodeTexImage")
        made[name].image = image(name, channels, is_data)
    links.new(made["color"].outputs["Color"], shader.inputs["Base Color"])
    bump = nodes.new("ShaderNodeNormalMap")
    links.new(made["bumps"].outputs["Color"], bump.inputs["Color"])
    links.new(bump.outputs["Normal"], shader.inputs["Normal"])
    apart = nodes.new("ShaderNodeSeparateColor")
    links.new(made["packed"].outputs["Color"], apart.inputs[0])
    links.new(apart.outputs[1], shader.inputs["Roughness"])
    links.new(apart.outputs[2], shader.inputs["Metallic"])
    return made


def found_in_groups() -> list[str]:
    """Images that the add-on finds in a material: one in a group, one that goes through it, one whose shader lies in it."""
    from ntc_viewer import swap

    group = bpy.data.node_groups.new("inner", "ShaderNodeTree")
    material = bpy.data.materials.new("grouped")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    own = nodes.new("ShaderNodeGroup")
    own.node_tree = group
    into, out = (group.nodes.new(f"NodeGroup{kind}") for kind in ("Input", "Output"))
    # Sockets of groups are declared since Blender 4.0, and before grew by a method of their own.
    for name, kind in (("Through", "INPUT"), ("Color", "OUTPUT"), ("Rough", "OUTPUT")):
        if bpy.app.version >= (4, 0, 0):
            group.interface.new_socket(name, in_out=kind, socket_type="NodeSocketColor")
        else:
            (group.inputs if kind == "INPUT" else group.outputs).new("NodeSocketColor", name)
    images = {}
    for name, tree in (("in the group", group), ("before it", material.node_tree)):
        images[name] = tree.nodes.new("ShaderNodeTexImage")
        images[name].image = bpy.data.images.new(name, 4, 4)
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    group.links.new(images["in the group"].outputs["Color"], out.inputs["Color"])
    group.links.new(into.outputs["Through"], out.inputs["Rough"])
    links.new(images["before it"].outputs["Color"], own.inputs["Through"])
    links.new(own.outputs["Color"], shader.inputs["Base Color"])
    links.new(own.outputs["Rough"], shader.inputs["Roughness"])
    inner = group.nodes.new("ShaderNodeBsdfPrincipled")
    group.links.new(into.outputs["Through"], inner.inputs["Metallic"])
    return sorted(f"{name}: {node.image.name}" for name, node, _ in swap.image_nodes(material))


def main() -> None:
    """Do it all."""
    # Only there once bpy is imported.
    import addon_utils

    # Reading the factory settings unloads add-ons.
    nodes = build()
    for name in ("io_scene_gltf2", "ntc_viewer"):
        addon_utils.enable(name, default_set=True)
    bpy.context.preferences.addons["ntc_viewer"].preferences.command = COMMAND
    settings = bpy.context.scene.ntc
    settings.bits = 8.0
    result: dict[str, Any] = {"version": list(bpy.app.version), "encode": list(bpy.ops.ntc.encode())}
    result["rows"] = [[row.name, row.bits, row.byte_count, row.psnr_db] for row in settings.rows]
    shown = {name: node.image for name, node in nodes.items()}
    settings.show_decoded = False
    originals = {name: node.image for name, node in nodes.items()}
    result["errors"] = {
        name: np.abs(pixels(shown[name]) - pixels(originals[name])).max(axis=(0, 1)).tolist() for name in nodes
    }
    result["originals"] = {name: own.name for name, own in originals.items()}
    settings.show_decoded = True
    result["again"] = {name: nodes[name].image == shown[name] for name in nodes}
    result["colorspaces"] = {name: own.colorspace_settings.name for name, own in shown.items()}
    result["export"] = list(bpy.ops.ntc.export(filepath=str(FOLDER / "exported.glb")))
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "saved.blend"))
    kept = [node for node in bpy.data.materials["plaster"].node_tree.nodes if node.type == "TEX_IMAGE"]
    result["reopened"] = sorted(node.image.name for node in kept)
    bpy.ops.ntc.forget()
    result["forgotten"] = sorted(node.image.name for node in kept)
    bpy.context.preferences.addons["ntc_viewer"].preferences.command = "no-such-program"
    try:
        bpy.ops.ntc.encode()
    except RuntimeError as error:
        result["missing"] = str(error)
    result["groups"] = found_in_groups()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon_utils.enable("io_scene_gltf2", default_set=True)
    bpy.ops.import_scene.gltf(filepath=str(FOLDER / "exported.glb"))
    result["imported"] = sorted(own.name for own in bpy.data.images)
    (FOLDER / "result.json").write_text(json.dumps(result))


main()
