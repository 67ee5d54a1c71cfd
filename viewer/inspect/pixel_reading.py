"""Reading back one pixel and its surroundings: a few kilobytes, and only when the mouse or the picture has changed."""

import math

import numpy as np

from viewer.inspect.block_content import BlockPlace, block_content
from viewer.inspect.pixel_content import PatchPlace, PixelContent, PixelPatch
from viewer.render.renderer import Renderer
from viewer.render.resources.visibility_buffer import materials_of, texture_ids_of
from viewer.state.view_state import BLOCKS, REFERENCE, Slot, ViewState

LEAST_FOOTPRINT = 1e-10


class PixelReader:
    """Remembers the last pixel."""

    def __init__(self) -> None:
        self._key: object = None
        self._content: PixelContent | None = None
        self.reads = 0
        """Times that something was read back."""

    def read(self, renderer: Renderer, view: ViewState, at: tuple[float, float]) -> PixelContent | None:
        """The pixel at `at` (shares of the picture from its upper left corner) of the last view that was drawn."""
        place = PatchPlace.at(at, view.size)
        key = (renderer, place, view.camera, view.overlay.block, renderer.pair_key())
        if key != self._key:
            self._content = self._read(renderer, view, place)
            self._key = key
            self.reads += 1
        return self._content

    def _read(self, renderer: Renderer, view: ViewState, place: PatchPlace) -> PixelContent:
        scene = renderer.scene
        words = renderer.visibility.words_at(place.x, place.y)
        texture_id, material = int(texture_ids_of(words[:1])[0]), int(materials_of(words[:1])[0])
        u, v, footprint = words[1:].view(np.float32).tolist() if material >= 0 else (0.0, 0.0, 0.0)
        texture = scene.textures[texture_id] if texture_id >= 0 else None
        sources = list(dict.fromkeys(s.source for s in (view.slot_a, view.slot_b) if s.source != REFERENCE))
        decoders = {source: renderer.decoders(source) for source in sources}
        block = BlockPlace.at(
            ((place.x + 0.5) / view.size[0], (place.y + 0.5) / view.size[1]), BLOCKS[view.overlay.block], view.size
        )
        content = block_content(renderer.texture_ids_in(block.pixels), block, scene, decoders)

        def patch(slot: Slot) -> PixelPatch | None:
            read = renderer.albedo_in(slot, place.pixels)
            return place.patch(read) if read is not None else None

        return PixelContent(
            x=place.x,
            y=place.y,
            picture=view.size,
            a=patch(view.slot_a),
            b=patch(view.slot_b),
            inside=place.inside,
            material_name=scene.materials[material].name if material >= 0 else None,
            texture_id=texture_id,
            texture_name=texture.name if texture is not None else "",
            uv=(u, v),
            lod=math.log2(max(footprint * texture.pixels.shape[1], LEAST_FOOTPRINT)) if texture is not None else None,
            decoders={source: table[texture_id] if texture_id >= 0 else -1 for source, table in decoders.items()},
            block_decoders={source: content.decoder_count(source) for source in sources},
        )
