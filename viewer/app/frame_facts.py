"""Facts of the last frame for panels, read back from the GPU only where a panel shows them."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.divergence import DivergenceStatistics
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.gl.ui_textures import NamedImages
from viewer.inspect.comparison import LiveFigures
from viewer.inspect.measurement import MeasuredPicture, error_of_each_map, measure
from viewer.inspect.memory_table import scene_memory
from viewer.inspect.picking import BlockContent, PixelContent, PlaceReader, read_block, read_pixel
from viewer.render.frames import FrameFigures, FrameTimes
from viewer.render.renderer import Renderer
from viewer.render.viewport import Viewport
from viewer.state.pack_files import pack_figures
from viewer.state.session import Session, SlotMeasurement
from viewer.state.view_state import REFERENCE, Side, Slot
from viewer.ui.facts import UiData


class FactsReader:
    """Reader of the picture for panels, which reads only what they show."""

    def __init__(self, context: GraphicsContext, session: Session, picture: Viewport, times: FrameTimes) -> None:
        self._renderer_name = context.info.renderer
        self._session, self._picture, self._times = session, picture, times
        self._images = NamedImages(context)
        self._blocks = PlaceReader[BlockContent](context, "the block under the mouse")
        self._counted: Mapping[str, DivergenceStatistics] = {}
        self.pixels = PlaceReader[PixelContent](context, "the pixel under the mouse")

    @property
    def is_pending(self) -> bool:
        """True while something for a panel is on its way from the GPU."""
        return self.pixels.is_pending or self._blocks.is_pending

    def read(self, live: LiveFigures, is_training: bool, encoding: Mapping[BlockFormat, float]) -> UiData:
        """Return the facts of the last frame; `live` is the result of comparing A with B, `encoding` the progress of block formats."""
        last, renderer, thumbnails = self._picture.last, self._picture.renderer, self._picture.thumbnails
        slots = (self._session.view.slot_a, self._session.view.slot_b)
        return UiData(
            renderer=self._renderer_name,
            frame=last or FrameFigures(),
            timings_ms=self._times.medians_ms(),
            divergence=self._divergence(),
            block=self._block(),
            thumbnail=self.thumbnail if thumbnails is not None else None,
            frames_drawn=self._picture.frames_drawn,
            is_preview=self._is_preview,
            live=live,
            is_training=is_training,
            encoding=encoding,
            pixel=self._pixel(),
            history=self._times.history,
            memory={
                slot: memory_of_slot
                for slot in slots
                if renderer and (memory_of_slot := renderer.memory(slot)) is not None
            },
            matches=renderer.matches if renderer is not None else {},
            image=self._image,
        )

    @property
    def _is_preview(self) -> bool:
        view = self._picture.last_view
        return view is not None and view.coarseness > 1

    def _divergence(self) -> Mapping[str, DivergenceStatistics]:
        """Return the divergence of the last whole picture: a preview counts fewer pixels of each block."""
        last = self._picture.last
        if last is not None and not (self._is_preview and last.divergence.keys() == self._counted.keys()):
            self._counted = last.divergence
        return self._counted

    def thumbnail(self, texture_id: int) -> imgui.ImTextureRef:
        """Return the thumbnail of a texture of the scene."""
        assert self._picture.thumbnails is not None
        return imgui.ImTextureRef(self._picture.thumbnails[texture_id].glo)

    def measuring(self) -> Iterator[Mapping[Side, SlotMeasurement]]:
        """Measure both slots of the present view: yield what is known after each step, which a frame has time for."""
        renderer, view = self._picture.renderer, self._picture.last_view
        if renderer is None or view is None:
            return
        results: dict[Side, SlotMeasurement] = {}
        pictures = measure(renderer, list(view.slots.values()), self._session.packs)
        for (side, slot), picture in zip(view.slots.items(), pictures, strict=True):
            results[side] = self._measured(renderer, slot, picture)
        yield dict(results)
        for side, slot in view.slots.items():
            if self._picture.last_view is not view:
                return
            with suppress(GpuMemoryError):
                results[side] = replace(results[side], draw_ms=renderer.drawing_ms(slot))
            yield dict(results)
        for side, slot in view.slots.items():
            if view.material_view == "base" or slot.source not in self._session.packs:
                continue
            errors = error_of_each_map(renderer, slot)
            # What was drawn since the last step may be another view, of another size.
            while self._picture.last_view is view and (error := next(errors, None)) is not None:
                if error.maps != "all":
                    by_map = {**results[side].psnr_by_map, error.maps: error.psnr_db}
                    results[side] = replace(results[side], psnr_by_map=by_map)
                yield dict(results)

    def _measured(self, renderer: Renderer, slot: Slot, picture: MeasuredPicture) -> SlotMeasurement:
        session = self._session
        if slot.source == REFERENCE:
            originals = scene_memory(session.scene)[0].bytes
            return SlotMeasurement(slot.source, None, None, originals)
        pack, memory = session.packs.get(slot.source), renderer.memory(slot)
        blocks = session.compressed_as(slot.source)
        psnr = picture.psnr_db(picture.covered)
        if pack is None:
            size = blocks.stored_bytes if blocks is not None else None
            return SlotMeasurement(slot.source, psnr, None, size, file_bytes=size)
        figures, last, loads = pack_figures(pack), self._picture.last, renderer.loads(slot)
        return SlotMeasurement(
            slot.source,
            psnr,
            picture.divergence_statistics,
            memory.total if memory is not None else None,
            file_bytes=figures.bytes,
            bits=figures.bits,
            path=last.paths.get(slot, slot.path) if last is not None else slot.path,
            compression_db=None if loads is None else loads.psnr_db,
            load_rate=None if loads is None else loads.texels_per_second,
        )

    def take_problems(self) -> tuple[str, ...]:
        """Return in lines what could not be shown for lack of memory since the last call."""
        parts = [part for part in (self._images, self._picture.thumbnails) if part is not None]
        return tuple(problem for part in parts if (problem := part.take_problem()) is not None)

    def release(self) -> None:
        """Free the images of panels."""
        for part in (self._images, self.pixels, self._blocks):
            part.release()

    def _image(self, name: str, pixels: NDArray[np.uint8]) -> imgui.ImTextureRef:
        return imgui.ImTextureRef(self._images.get(name, pixels).glo)

    def _pixel(self) -> PixelContent | None:
        """Return the pixel of the panel Pixel, while it is open."""
        session, renderer, view = self._session, self._picture.renderer, self._picture.last_view
        at = session.inspection.pixel or session.inspection.hovered
        if (
            renderer is None
            or view is None
            or at is None
            or not ("Pixel" in session.window.open_panels and session.window.show_panels)
        ):
            self.pixels.forget()
            return None
        return read_pixel(self.pixels, renderer, view, at)

    def _block(self) -> BlockContent | None:
        """Return the block of the panel Divergence, while the map is shown."""
        session, renderer, view = self._session, self._picture.renderer, self._picture.last_view
        at = session.inspection.block or session.inspection.hovered
        if renderer is None or view is None or view.overlay.kind != "divergence" or at is None:
            self._blocks.forget()
            return None
        if view.coarseness > 1:
            # A preview has fewer pixels, and so fewer textures in a block than at rest.
            self._blocks.forget()
            return None
        return read_block(self._blocks, renderer, session.packs, view, at)
