"""Description of scene and pack for the page: `page.json`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ntc.codec.gpu import WRAP_CODES
from ntc.codec.latents import texture_levels
from ntc.codec.maps import PLANES, Plane, plane_channels
from ntc.codec.model import EncodedTexture, Pack
from ntc.codec.quality import finite_or_none
from ntc.metrics.metrics import bits_with_mips, psnr_table
from viewer.scene.model import Camera, Light, Material, PlaneTexture, Scene
from viewer.state.camera import clip_distances
from viewer.state.framing import frame_all

FORMAT = 1
"""Version of `page.json`: raised with each change that an older page would misread."""


@dataclass(frozen=True)
class PageFile:
    """A file of the folder."""

    name: str
    """Path of the file, with `/`."""
    size: int
    """Bytes."""
    crc: int
    """CRC-32: browsers have no digests where a page is not served by HTTPS."""

    def json(self) -> dict[str, Any]:
        """Return the entry as the page reads it."""
        return {"file": self.name, "bytes": self.size, "crc32": self.crc}


@dataclass(frozen=True)
class TextureFiles:
    """The files of one texture."""

    packed: PageFile
    """Record, levels and latents, one after the other."""
    record_bytes: int
    level_bytes: int
    originals: Mapping[Plane, PageFile]
    """Pictures to compare with."""
    alpha: PageFile | None
    """Coverage."""


def texture_planes(texture: EncodedTexture) -> tuple[Plane, ...]:
    """Return the planes that a texture of a pack has maps of."""
    return tuple(plane_channels(texture.maps, texture.channels))


def describe_texture(pack: Pack, texture: EncodedTexture, files: TextureFiles) -> dict[str, Any]:
    """Return an entry of `textures`."""
    levels = texture_levels(texture, pack.config)
    return {
        "name": texture.name,
        "decoder": texture.group,
        "mips": [[level.texel_width, level.texel_height] for level in levels],
        "planes": texture_planes(texture),
        "psnr_db": finite_or_none(texture.psnr_db),
        "packed": {**files.packed.json(), "record": files.record_bytes, "levels": files.level_bytes},
        "originals": {plane: file.json() for plane, file in files.originals.items()},
        "alpha": files.alpha.json() if files.alpha is not None else None,
    }


def describe_material(material: Material, pack: Pack, texture_index: Sequence[int], page: Mapping[int, int]) -> Any:
    """Return an entry of `materials`. `texture_index`: by texture of the scene that of the pack, or -1; `page`: by texture of the
    scene that of the page."""

    def place(plane: Plane, found: PlaneTexture) -> dict[str, Any] | None:
        index = texture_index[found.texture_id]
        if index < 0 or plane not in texture_planes(pack.textures[index]):
            return None
        maps = [name for name in found.maps if name in pack.textures[index].maps]
        sampler = found.sampler
        return {
            "texture": page[found.texture_id],
            "maps": maps,
            "wrap": [WRAP_CODES[mode] for mode in sampler.wrap],
            "linear": [sampler.magnify_linear, sampler.minify_linear],
            "mipmap": sampler.mipmap,
        }

    planes = {plane: found for plane in PLANES if (found := material.plane(plane)) is not None}
    factors = material.factors
    return {
        "name": material.name,
        "factor": material.factor,
        "alpha_mode": material.alpha_mode,
        "alpha_cutoff": material.alpha_cutoff,
        "double_sided": material.double_sided,
        "unlit": material.unlit,
        "roughness": factors.roughness,
        "metalness": factors.metalness,
        "normal_scale": factors.normal_scale,
        "occlusion_strength": factors.occlusion_strength,
        "emissive": factors.emissive,
        "planes": {plane: own for plane, found in planes.items() if (own := place(plane, found)) is not None},
    }


def _camera(scene: Scene, camera: Camera) -> dict[str, Any]:
    near, far = clip_distances(camera, scene.bounds)
    return {
        "name": camera.name,
        "eye": camera.eye,
        "target": camera.target,
        "up": camera.up,
        "fov": camera.fov_degrees,
        "height": camera.orthographic_height,
        "near": near,
        "far": far,
    }


def _light(light: Light) -> dict[str, Any]:
    return {
        "kind": light.kind,
        "color": light.color,
        "position": light.position,
        "direction": light.direction,
        "reach": light.reach,
        "cones": [light.inner_cone, light.outer_cone],
    }


def describe_figures(pack: Pack, scene: Scene, chosen: Sequence[int], original_bytes: int) -> dict[str, Any]:
    """Return the figures that the page shows; `original_bytes` of pixels that the textures `chosen` of the pack stand for."""
    table = psnr_table(pack)
    summary = table.summary
    size = table.latent_bytes + table.decoder_bytes + table.adapter_bytes
    return {
        "codec": pack.config.kind,
        "grouping": pack.grouping.name,
        "decoders": len({pack.textures[index].group for index in chosen}),
        "textures": len(chosen),
        "materials": len(scene.materials),
        "triangles": int(
            sum(scene.primitives[number].index_count // 3 for number in scene.instances.primitive.tolist())
        ),
        "pack_bytes": size,
        "original_bytes": original_bytes,
        "bits_per_texel": bits_with_mips(pack),
        "psnr_db": finite_or_none(summary.of_mean_mse_db) if summary is not None else None,
        "psnr_min_db": finite_or_none(summary.minimum_db) if summary is not None else None,
    }


def describe_view(scene: Scene) -> dict[str, Any]:
    """Return where the page looks from, and what lights the scene."""
    cameras = scene.cameras or (frame_all(scene),)
    return {
        "bounds": scene.bounds.tolist(),
        "cameras": [_camera(scene, camera) for camera in cameras],
        "lights": [_light(light) for light in scene.lights],
    }
