"""Measured values of lit pictures: drawn from the pack and from the original images, at cameras of the scene and in two lights."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import msgspec
import numpy as np
from numpy.typing import NDArray

from ntc.codec.model import Pack
from ntc.codec.quality import finite_or_none
from ntc.content_cache import ContentCache
from ntc.metrics.image_quality import flip
from ntc.metrics.perceptual import has_jod, has_ssimulacra2, jod, ssimulacra2
from viewer.checking.record import TextureRecord, ViewRecord
from viewer.gl.context import GraphicsContext
from viewer.inspect.measurement import WholeDrawing, measure
from viewer.jobs.job import Background
from viewer.scene.images import ProgressReport
from viewer.scene.model import Camera, Scene
from viewer.state.event_handlers import apply_event
from viewer.state.events import ViewChanged
from viewer.state.open_files import InitialView, new_session
from viewer.state.settings import ViewerSettings
from viewer.state.view_state import Lighting, Slot, ViewState

LIGHTS: Mapping[str, Lighting] = {"sun": Lighting(), "low sun": Lighting(sun_azimuth=320.0, sun_elevation=12.0)}
"""Lights by name: the default one, and one that grazes surfaces from the other side, which shows errors of normals."""
DIGITS = 40


@dataclass(frozen=True)
class MeasuredViews:
    """Records of the measured pictures."""

    records: tuple[ViewRecord, ...]
    gpu_bytes: int | None
    """Bytes of the pack on the GPU; None where there is no picture."""
    measured: int
    """Number of pictures that were drawn; the values of the others were cached."""


class CachedView(msgspec.Struct, frozen=True):
    """Cached values of a measured picture."""

    record: ViewRecord
    gpu_bytes: int


def scene_content(scene: Scene, textures: Sequence[TextureRecord]) -> str:
    """Return the identity of the content of pictures of `scene`, without the camera: shapes, materials, originals and encoded
    textures."""
    digest = hashlib.sha256()
    shapes = scene.geometry
    arrays: list[NDArray[np.generic] | None] = [shapes.positions, shapes.uvs, shapes.colors, shapes.indices]
    arrays += [shapes.normals, shapes.tangents, shapes.second_uvs, scene.instances.transform, scene.instances.primitive]
    for array in arrays:
        if array is not None:
            digest.update(np.ascontiguousarray(array).data)
    facts = [scene.primitives, scene.materials, scene.lights, [(t.pixel_hash, t.set_hash) for t in scene.textures]]
    digest.update(repr(facts).encode("utf-8", "replace"))
    digest.update("".join(texture.content for texture in textures).encode())
    return digest.hexdigest()[:DIGITS]


@dataclass(frozen=True, eq=False)
class ViewsToMeasure:
    """Pictures of a check that are to be measured."""

    scene: Scene
    source: str
    """Name of the pack among the open ones."""
    pack: Pack
    cameras: Sequence[Camera]
    size: tuple[int, int]
    """(width, height) in pixels."""
    content: str
    """Identity of the scene and its textures (`scene_content`)."""

    def pictures(self) -> list[tuple[Camera, str, str]]:
        """Return (camera, light, identity of the picture) of every picture."""
        identified = []
        for camera in self.cameras:
            for light, lighting in LIGHTS.items():
                # Part of the key, so that a measure is computed once its package is installed.
                facts = repr((self.content, camera, self.size, asdict(lighting), has_jod(), has_ssimulacra2()))
                identified.append((camera, light, hashlib.sha256(facts.encode()).hexdigest()[:DIGITS]))
        return identified


def cached_views(views: ViewsToMeasure, cache: ContentCache) -> MeasuredViews | None:
    """Return the cached values of all pictures of `views`; None where one is missing."""
    cached = [cache.read_value(content, CachedView) for _, _, content in views.pictures()]
    if any(each is None for each in cached):
        return None
    known = [each for each in cached if each is not None]
    return MeasuredViews(tuple(each.record for each in known), known[-1].gpu_bytes if known else None, 0)


def measured_views(
    context: GraphicsContext, views: ViewsToMeasure, cache: ContentCache, report: ProgressReport | None = None
) -> MeasuredViews:
    """Return the values of all pictures of `views`, drawn now. Raises InputError where one cannot be drawn, ContextLostError."""
    session = new_session(views.scene, {views.source: views.pack}, ViewerSettings(), InitialView())
    background = Background()
    drawing = WholeDrawing(context, session, background)
    records: list[ViewRecord] = []
    gpu_bytes = 0
    pictures = views.pictures()
    for number, (camera, light, content) in enumerate(pictures):
        slot = Slot(views.source)
        view = ViewState(camera, views.size, slot, material_view="lit", lighting=LIGHTS[light])
        apply_event(session, ViewChanged(replace(view, compare="a")))
        _, renderer = drawing.draw(views.size)
        (picture,) = measure(renderer, [slot], session.packs)
        memory = renderer.memory(slot)
        gpu_bytes = memory.total if memory is not None else 0
        record = ViewRecord(
            camera=camera.name,
            light=light,
            content=content,
            psnr_db=finite_or_none(picture.psnr_db(picture.covered)),
            flip=flip(picture.reference, picture.color),
            divergence=picture.divergence_statistics.score,
            ssimulacra2=ssimulacra2(picture.reference, picture.color) if has_ssimulacra2() else None,
            jod=jod(picture.reference, picture.color) if has_jod() else None,
        )
        cache.write_value(content, CachedView(record, gpu_bytes))
        records.append(record)
        if report is not None:
            report.progress(number + 1, len(pictures))
    background.close()
    return MeasuredViews(tuple(records), gpu_bytes, len(records))
