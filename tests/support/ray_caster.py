"""A slow, independent picture of a scene: one ray for each pixel against every triangle, in float64."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from viewer.scene.model import Camera, Material, Scene

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CastPicture:
    """Hits of rays: of a picture [H, W], row 0 on top; of single rays [N]."""

    texture_id: NDArray[np.int32]
    """[H, W] -1 where nothing is seen or the material has no texture."""
    material: NDArray[np.int32]
    """[H, W] -1 for the background."""
    uv: Array
    """[H, W, 2] texture coordinates, not wrapped."""
    distance: Array
    """[H, W] along the ray; infinite for the background."""

    def reshaped(self, *shape: int) -> "CastPicture":
        """The same in an array of `shape`."""
        uv = self.uv.reshape(*shape, 2)
        return CastPicture(
            self.texture_id.reshape(shape), self.material.reshape(shape), uv, self.distance.reshape(shape)
        )


def camera_rays(camera: Camera, size: tuple[int, int]) -> tuple[Array, Array]:
    """(origins [H * W, 3], directions [H * W, 3]) through the pixel centres of a picture of `size` (width, height)."""
    eye, target = np.array(camera.eye, float), np.array(camera.target, float)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, np.array(camera.up, float))
    right /= np.linalg.norm(right)
    above = np.cross(right, forward)
    x = ((np.arange(size[0]) + 0.5) / size[0] * 2.0 - 1.0) * size[0] / size[1]
    y = 1.0 - (np.arange(size[1]) + 0.5) / size[1] * 2.0
    across, up = np.tile(x, size[1])[:, None], np.repeat(y, size[0])[:, None]
    if camera.orthographic_height is not None:
        half = camera.orthographic_height / 2.0
        return eye + across * half * right + up * half * above, np.tile(forward, (size[0] * size[1], 1))
    half = np.tan(np.radians(camera.fov_degrees) / 2.0)
    directions = forward + across * half * right + up * half * above
    return np.tile(eye, (size[0] * size[1], 1)), directions


def _wrapped(texel: NDArray[np.int64], texels: int, mode: str) -> NDArray[np.int64]:
    if mode == "clamp":
        return np.clip(texel, 0, texels - 1)
    if mode == "repeat":
        return texel % texels
    folded = texel % (2 * texels)
    return np.where(folded < texels, folded, 2 * texels - 1 - folded)


def _passes_alpha(scene: Scene, material: Material, uv: Array, vertex_alpha: Array) -> NDArray[np.bool_]:
    """[N] whether the nearest texel's alpha at `uv` [N, 2] passes a MASK material's cutoff."""
    if material.alpha_mode != "mask":
        return np.ones(len(uv), bool)
    alpha = material.factor[3] * vertex_alpha
    image = scene.textures[material.texture_id].alpha if material.texture_id >= 0 else None
    if image is not None:
        height, width = image.shape
        texel = np.floor(uv * (width, height)).astype(np.int64)
        columns = _wrapped(texel[:, 0], width, material.sampler.wrap[0])
        rows = _wrapped(texel[:, 1], height, material.sampler.wrap[1])
        alpha = alpha * image[rows, columns] / 255.0
    return alpha >= material.alpha_cutoff


def cast_scene(scene: Scene, camera: Camera, size: tuple[int, int]) -> CastPicture:
    """The picture of `scene`."""
    return cast_rays(scene, *camera_rays(camera, size)).reshaped(size[1], size[0])


def cast_rays(scene: Scene, origins: Array, directions: Array) -> CastPicture:
    """Return the first hits of rays [N, 3] (Moeller-Trumbore). Backs of single-sided triangles are not hit; BLEND is not supported."""
    rays = len(origins)
    nearest = np.full(rays, np.inf)
    material_id, uv = np.full(rays, -1, np.int32), np.zeros((rays, 2))
    geometry = scene.geometry
    for row, transform in zip(scene.instances.primitive, scene.instances.transform.astype(np.float64), strict=True):
        primitive = scene.primitives[row]
        material = scene.materials[primitive.material]
        index = geometry.indices[primitive.first_index : primitive.first_index + primitive.index_count]
        index = index.astype(np.int64).reshape(-1, 3) + primitive.base_vertex
        if np.linalg.det(transform[:3, :3]) < 0.0:
            # glTF: a mirroring transform turns the winding of front faces round.
            index = index[:, [0, 2, 1]]
        for corners in index:
            a, b, c = geometry.positions[corners].astype(np.float64) @ transform[:3, :3].T + transform[:3, 3]
            ab, ac = b - a, c - a
            p = np.cross(directions, ac)
            determinant = p @ ab
            front = determinant > 1e-12
            usable = np.abs(determinant) > 1e-12 if material.double_sided else front
            inverse = 1.0 / np.where(usable, determinant, 1.0)
            s = origins - a
            first = np.einsum("ij,ij->i", p, s) * inverse
            q = np.cross(s, ab)
            second = np.einsum("ij,ij->i", directions, q) * inverse
            along = (q @ ac) * inverse
            inside = (first >= 0.0) & (second >= 0.0) & (first + second <= 1.0)
            hit = np.nonzero(usable & inside & (along > 1e-9) & (along < nearest))[0]
            weights = np.stack([1.0 - first[hit] - second[hit], first[hit], second[hit]], axis=-1)
            at = weights @ geometry.uvs[corners].astype(np.float64)
            alphas = (
                np.ones(len(hit)) if geometry.colors is None else weights @ geometry.colors[corners, 3].astype(float)
            )
            opaque = _passes_alpha(scene, material, at, alphas)
            hit = hit[opaque]
            nearest[hit], material_id[hit], uv[hit] = along[hit], primitive.material, at[opaque]
    texture_of = np.array([*(m.texture_id for m in scene.materials), -1], np.int32)
    return CastPicture(texture_of[material_id], material_id, uv, nearest)
