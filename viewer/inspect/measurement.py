"""Measurement of slots: quality and divergence of the picture, of all maps and of each map alone.

The command `render`, the window's Measure and scripts use it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import MAPS, PLANE_OF_MAP, ShownMap
from ntc.codec.mips import linear_to_srgb8
from ntc.codec.model import Pack
from ntc.codec.quality import finite_or_none, psnr_db
from ntc.errors import InputError
from ntc.metrics.divergence import DivergenceStatistics, divergence_map
from ntc.pack.match import PackMatch
from viewer.gl.context import GraphicsContext
from viewer.jobs.job import Background
from viewer.render.frames import FrameResult, FrameTimes
from viewer.render.renderer import Renderer
from viewer.render.viewport import Viewport
from viewer.state.event_handlers import apply_event
from viewer.state.events import Event, Notification
from viewer.state.session import Session
from viewer.state.view_state import BLOCKS, REFERENCE, BlockName, DecodedMaps, Overlay, Slot


def decoder_ids(texture_ids: NDArray[np.int32], pack: Pack, match: PackMatch) -> NDArray[np.int32]:
    """Return the decoder [H, W] int32 of each pixel from its texture id [H, W]; -1 where the pack decodes nothing."""
    return np.array([*match.decoders(pack), -1], dtype=np.int32)[texture_ids]


class WholeDrawing:
    """Drawing of complete pictures of a session's view without a window. Events change the session; errors end the work."""

    def __init__(
        self,
        context: GraphicsContext,
        session: Session,
        background: Background,
        tell: Callable[[str], object] = lambda _: None,
    ) -> None:
        """Make the drawing. `tell` is called with the text of each notification that is not an error."""
        self._session, self._tell = session, tell
        self._errors: list[str] = []
        self.viewport = Viewport(context, session, FrameTimes(context.waits), background, self._emit)

    def _emit(self, event: Event) -> None:
        if isinstance(event, Notification) and event.kind == "error":
            self._errors.append(event.text)
        elif isinstance(event, Notification):
            self._tell(event.text)
        else:
            apply_event(self._session, event)

    def draw(self, size: tuple[int, int]) -> tuple[FrameResult, Renderer]:
        """Draw the session's view at `size` (width, height) in pixels. Raises InputError where it cannot be drawn."""
        viewport = self.viewport
        viewport.draw(size, whole=True)
        if viewport.last is None or viewport.last_view is None or viewport.renderer is None:
            raise InputError(self._errors[0])
        return viewport.last, viewport.renderer


@dataclass(frozen=True, eq=False)
class MeasuredPicture:
    """Picture of a slot at full resolution, beside the picture of the original images. All arrays have row 0 on top."""

    source: str
    color: NDArray[np.uint8]
    """Picture of the slot: [H, W, 3] uint8 sRGB; maps have a black background."""
    reference: NDArray[np.uint8]
    """Picture of the original images: [H, W, 3] uint8 sRGB."""
    covered: NDArray[np.bool_]
    """Mask [H, W] of pixels that show a surface."""
    texture_ids: NDArray[np.int32]
    """Texture id of each pixel [H, W], -1 for none."""
    decoder_ids: NDArray[np.int32]
    """Decoder of each pixel [H, W], -1 where nothing is decoded."""
    divergence: NDArray[np.uint16]
    """Number of different decoders in each block: [ceil(H / block height), ceil(W / block width)]."""

    @property
    def divergence_statistics(self) -> DivergenceStatistics:
        """Figures of the divergence map."""
        return DivergenceStatistics.of(self.divergence)

    def psnr_db(self, mask: NDArray[np.bool_]) -> float | None:
        """Return the PSNR in dB of the pixels of `mask` [H, W] against the reference, over 8-bit sRGB.

        Equal pixels give infinity; the reference itself and an empty mask give None.
        """
        if self.source == REFERENCE or not mask.any():
            return None
        return psnr_db(self.color[mask], self.reference[mask])


def measure(
    renderer: Renderer, slots: Sequence[Slot], packs: Mapping[str, Pack], block: BlockName = Overlay.block
) -> list[MeasuredPicture]:
    """Draw the renderer's last view at full resolution for each of `slots`. Raises ContextLostError.

    Divergence (the paper, Sec. 2, Eq. 1) is the number D of distinct decoders in a framebuffer block of shape `block`. The GPU runs
    one decoder of a block after the other, so that max(D - 1, 0) runs are in excess. `DivergenceStatistics` has their sum over all
    blocks (excess) and their mean (score).
    """
    reference = linear_to_srgb8(renderer.picture(Slot(REFERENCE)))
    covered, texture_ids = renderer.covered(), renderer.texture_ids()
    width, height = BLOCKS[block]
    pictures = []
    for slot in slots:
        color = reference if slot.source == REFERENCE else linear_to_srgb8(renderer.picture(slot))
        pack, match = packs.get(slot.source), renderer.matches.get(slot.source)
        ids = np.full_like(texture_ids, -1)
        if pack is not None and match is not None:
            ids = decoder_ids(texture_ids, pack, match)
        counts = divergence_map(ids, (height, width))
        pictures.append(MeasuredPicture(slot.source, color, reference, covered, texture_ids, ids, counts))
    return pictures


@dataclass(frozen=True, eq=False)
class MapError:
    """Error of a picture with some maps decoded and all others original, over 8-bit sRGB of the covered pixels."""

    maps: DecodedMaps
    """Decoded maps: one map, or all."""
    mean_squared_error: float
    """Mean squared error in squared steps of 1/255."""
    psnr_db: float | None
    """PSNR in dB; None where the pictures are equal."""
    by_texture: NDArray[np.float64]
    """Sum of squared errors over the pixels of each texture, in squared steps: [textures of the scene]."""
    squared_error: NDArray[np.float32]
    """Squared error of each pixel, the mean over RGB in squared steps: [H, W], row 0 on top."""


def shown_maps(renderer: Renderer, slot: Slot) -> tuple[ShownMap, ...]:
    """Return the decoded maps of `slot` that the last view shows, in the order of MAPS."""
    drawn = renderer.decoded_planes(slot)
    scene_maps = {name for texture in renderer.scene.textures for name in texture.maps}
    return tuple(name for name in MAPS if PLANE_OF_MAP[name] in drawn and name in scene_maps)


def errors_by_map(renderer: Renderer, slot: Slot) -> tuple[MapError, ...]:
    """Measure the error of the last view with each map decoded alone, and at the end with all maps decoded."""
    return tuple(error_of_each_map(renderer, slot))


def error_of_each_map(renderer: Renderer, slot: Slot) -> Iterator[MapError]:
    """Yield the errors of `errors_by_map`, each when it is measured.

    Errors of single maps do not add up to the error of all maps, because shading multiplies some maps.
    """
    reference = linear_to_srgb8(renderer.picture(Slot())).astype(np.float64)
    covered, textures = renderer.covered(), renderer.texture_ids()
    chosen: Sequence[DecodedMaps] = (*shown_maps(renderer, slot), "all")
    for maps in chosen:
        shown = linear_to_srgb8(renderer.picture(replace(slot, maps=maps))).astype(np.float64)
        squared = np.where(covered, np.square(shown - reference).mean(axis=2), 0.0)
        error = float(squared.sum() / max(1, covered.sum()))
        textured = textures >= 0
        sums = np.bincount(textures[textured], weights=squared[textured], minlength=len(renderer.scene.textures))
        psnr = finite_or_none(10.0 * np.log10(255.0**2 / error)) if error > 0.0 else None
        yield MapError(maps, error, psnr, sums.astype(np.float64), squared.astype(np.float32))
