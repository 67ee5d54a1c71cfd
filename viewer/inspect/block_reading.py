"""Reading back one block of the divergence map, when it or the picture has changed."""

from collections.abc import Mapping

from ntc.pack.model import Pack
from viewer.inspect.block_content import BlockContent, BlockPlace, block_content
from viewer.render.renderer import Renderer
from viewer.state.view_state import BLOCKS, REFERENCE, ViewState


class BlockReader:
    """Remembers the last block."""

    def __init__(self) -> None:
        self._key: object = None
        self._content: BlockContent | None = None

    def read(
        self, renderer: Renderer, packs: Mapping[str, Pack], view: ViewState, at: tuple[float, float]
    ) -> BlockContent | None:
        """The block at `at` (shares of the picture from its upper left corner) of the last view that was drawn."""
        place = BlockPlace.at(at, BLOCKS[view.overlay.block], view.size)
        sources = [slot.source for slot in (view.slot_a, view.slot_b) if slot.source != REFERENCE]
        key = (renderer, packs, view.camera, place, sources)
        if key != self._key:
            decoders = {source: renderer.decoders(source) for source in sources}
            ids = renderer.texture_ids_in(place.pixels)
            self._content, self._key = block_content(ids, place, renderer.scene, decoders), key
        return self._content
