"""A pack on the GPU in one precision, with the decode paths that read it; each is made when it is first used."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ntc.pack.diff import changed_textures, same_shape
from ntc.pack.match import PackMatch
from ntc.pack.model import Pack
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.gl.timer import PassTimer
from viewer.render.passes.decode_binned import DecodeBinnedPass
from viewer.render.passes.decode_deferred import DecodeDeferredPass
from viewer.render.passes.decode_forward import DecodeForwardPass
from viewer.render.passes.needed_levels import NeededLevelsPass
from viewer.render.resources.albedo_target import AlbedoTarget
from viewer.render.resources.culling import DrawList
from viewer.render.resources.decoder_ranges import DecoderRanges
from viewer.render.resources.latent_store import LatentBudget, LatentCounts
from viewer.render.resources.pack_buffers import PackBuffers
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.visibility_buffer import VisibilityTarget
from viewer.render.tile_cache.budget import TileBudget, TileCacheConfig, TileCounts
from viewer.render.tile_cache.decode_cached import DecodeCachedPass
from viewer.render.tile_cache.tile_table import TileTable
from viewer.scene.model import Scene
from viewer.state.view_state import PathChoice, Precision

BANDS = 4
"""Parts in which a picture is drawn anew while the one before is still shown: none of them makes a frame long."""
FRAMES_AHEAD = 12
"""That decode tiles and show the picture before, where all tiles are there in an older version."""
FRAMES_AHEAD_OF_MISSING = 4
"""The same where tiles are shown coarser, and frames are long."""


@dataclass(frozen=True, eq=False)
class VisibilityInputs:
    """What a decode path decodes for."""

    visibility: VisibilityTarget
    draw_list: DrawList
    matrix: NDArray[np.float64]
    """[4, 4] world to clip."""
    anisotropy: int
    """Of path `cached`: 1 (trilinear) to 16."""
    key: object
    """Equal for equal views."""


@dataclass(frozen=True, eq=False)
class RenderContext:
    """What draws, for all packs of a scene."""

    context: GraphicsContext
    scene: Scene
    scene_buffers: SceneBuffers
    timer: PassTimer
    tile_cache: TileCacheConfig
    tile_budget: TileBudget
    latents: LatentBudget
    emulate_half: bool = False
    """Round in single precision what the driver cannot compute in halves: for tests and studies."""


@dataclass
class GpuPack:
    """Buffers and passes of one pack."""

    context: RenderContext
    pack: Pack
    match: PackMatch
    precision: Precision
    programs: ProgramFactory
    """With the includes for the pack's codec."""
    _cached: DecodeCachedPass | None = None
    _bands_left: int = 0
    """Parts of the picture that are still to be drawn."""
    _ahead: int = 0
    """Times that tiles were decoded since the last context, which then decodes none."""
    _asked: object = None
    """The view whose tiles the cache was asked for last."""
    _made: list[PackBuffers | DecoderRanges | DecodeBinnedPass | DecodeCachedPass | NeededLevelsPass] = field(
        default_factory=list
    )

    @cached_property
    def decoders(self) -> tuple[int, ...]:
        """Decoder of every texture of the scene; -1 where nothing is decoded."""
        return self.match.decoders(self.pack)

    @cached_property
    def buffers(self) -> PackBuffers:
        """Latents, tables and weights."""
        made = PackBuffers(
            self.context.context,
            self.pack,
            self.match.texture_index,
            self.precision,
            self.context.emulate_half,
            on_demand=self.context.latents,
        )
        self._made.append(made)
        return made

    @cached_property
    def _ranges(self) -> DecoderRanges:
        made = DecoderRanges(self.context.context, self.pack, self.precision)
        self._made.append(made)
        return made

    @property
    def _colors(self) -> bool:
        return self.context.scene_buffers.has_colors

    @cached_property
    def _deferred(self) -> DecodeDeferredPass:
        used = {decoder for decoder in self.decoders if decoder >= 0}
        shared = used.pop() if len(used) == 1 else None
        ranges = self._ranges if shared is not None else None
        return DecodeDeferredPass(self.context.context, self.programs, self.buffers, ranges, self._colors, shared)

    @cached_property
    def _forward(self) -> DecodeForwardPass:
        return DecodeForwardPass(self.context.context, self.programs, self.buffers, self._colors)

    @cached_property
    def _binned(self) -> DecodeBinnedPass:
        made = DecodeBinnedPass(
            self.context.context, self.programs, self.buffers, self._ranges, self.pack, self._colors
        )
        self._made.append(made)
        return made

    def _tile_cache(self) -> DecodeCachedPass:
        if self._cached is None:
            table = TileTable.of(self.context.scene.materials, self.pack, self.match)
            self._cached = DecodeCachedPass(
                self.context.context,
                self.programs,
                self.buffers,
                self._ranges,
                table,
                self.decoders,
                self._colors,
                self.context.tile_cache,
                self.context.tile_budget,
            )
            self._made.append(self._cached)
        return self._cached

    @cached_property
    def _needed_levels(self) -> NeededLevelsPass:
        count = len(self.match.texture_index)
        made = NeededLevelsPass(self.context.context, self.programs, count, self._colors)
        self._made.append(made)
        return made

    def _upload_latents(self, seen: VisibilityInputs) -> None:
        """Have the mips on the GPU that this view reads."""
        drawn = dict.fromkeys(self._textures_in(seen.draw_list), 0)
        if self.buffers.has(drawn):
            return
        with self.context.timer.measure("latents"):
            needed = self._needed_levels.run(seen.visibility, self.context.scene_buffers, self.buffers)
            self.buffers.need(needed)

    @property
    def latents(self) -> LatentCounts:
        """What of the latents is on the GPU."""
        return self.buffers.latents

    @property
    def bytes_on_gpu(self) -> int:
        """All buffers and textures."""
        return sum(part.bytes_on_gpu for part in self._made)

    @property
    def bytes_by_part(self) -> dict[str, int]:
        """`bytes_on_gpu`, by what it is for; adapters count as decoders."""
        parts: dict[str, int] = {}
        for part in self._made:
            if isinstance(part, PackBuffers):
                parts |= part.bytes_by_part
                continue
            name = "tables"
            if isinstance(part, DecodeCachedPass):
                name = "tile cache"
            elif isinstance(part, DecoderRanges):
                name = "decoders"
            parts[name] = parts.get(name, 0) + part.bytes_on_gpu
        return parts

    @property
    def latent_bytes(self) -> NDArray[np.int64]:
        """[textures of the scene] int64: latents of each that are on the GPU."""
        return self.buffers.latent_bytes

    @property
    def tiles(self) -> TileCounts | None:
        """The tile cache, where path `cached` has been used."""
        if self._cached is None:
            return None
        counts = self._cached.counts
        # What was decoded but not drawn is still to be seen.
        return replace(counts, waiting=max(counts.waiting, 1)) if self._ahead or self._bands_left else counts

    def is_waiting(self, path: PathChoice) -> bool:
        """Whether the picture by `path` will still become better with the same view."""
        return path == "cached" and self.tiles is not None and self.tiles.waiting > 0

    def decode_ahead(self, path: PathChoice) -> bool:
        """Decode tiles without context, where all are there in an older version, or frames are long; False when it is time to draw.

        RenderContext costs as much as decoding many tiles: the picture is drawn anew once for several times that tiles are decoded.
        """
        cache = self._cached
        if path != "cached" or cache is None or self._bands_left:
            return False
        most = FRAMES_AHEAD if cache.only_stale else 0
        if cache.is_missing_tiles and self.context.tile_budget.is_tight:
            most = FRAMES_AHEAD_OF_MISSING
        if self._ahead >= most:
            return False
        self._ahead += 1
        with self.context.timer.measure("decode_cached"):
            done = cache.decode(cache.tiles_ahead())
        cache.note_time(done, self.context.timer.last_ms)
        return True

    def decode(
        self, path: PathChoice, seen: VisibilityInputs, target: AlbedoTarget, whole: bool, in_bands: bool = False
    ) -> float:
        """Draw linear albedo; the time in ms. With `whole` path `cached` decodes whatever is missing, however long it takes.

        With `in_bands` path `cached` may draw some rows only: `is_half_drawn` until the next calls have drawn the others.
        """
        context, timer = self.context, self.context.timer
        if path == "cached":
            return self._decode_cached(seen, target, whole, in_bands)
        self._upload_latents(seen)
        # Made outside of the measured time: compiling is no part of a frame.
        chosen: DecodeForwardPass | DecodeBinnedPass | DecodeDeferredPass
        if path == "forward":
            chosen = self._forward
        elif path == "binned":
            chosen = self._binned
        else:
            chosen = self._deferred
        with timer.measure(f"decode_{path}"):
            if isinstance(chosen, DecodeForwardPass):
                chosen.run(seen.visibility, context.scene_buffers, target, seen.matrix)
            elif isinstance(chosen, DecodeBinnedPass):
                chosen.run(seen.visibility, context.scene_buffers, target, self._decoders_in(seen.draw_list))
            else:
                chosen.run(seen.visibility, context.scene_buffers, target)
        return timer.last_ms

    @property
    def is_half_drawn(self) -> bool:
        """Whether the last `decode` left rows of the picture for the next ones."""
        return self._bands_left > 0

    def _decode_cached(self, seen: VisibilityInputs, target: AlbedoTarget, whole: bool, in_bands: bool) -> float:
        cache, timer, name = self._tile_cache(), self.context.timer, "decode_cached"
        spent = 0.0
        # Only after frames that decoded ahead: else a picture that lacks tiles is to become better in every frame.
        in_bands = in_bands and not whole and self._asked == seen.key and bool(self._ahead or self._bands_left)
        if in_bands and self._bands_left:
            return self._sample_band(seen, target)
        self._bands_left = 0
        while True:
            if self._asked != seen.key or cache.request_overflowed:
                with timer.measure(name):
                    cache.request(seen.visibility, self.context.scene_buffers, seen.anisotropy)
                spent += timer.last_ms
                self._asked = seen.key
            wanted = 0 if self._ahead and not whole else cache.tiles_now(whole)
            self._ahead = 0
            if wanted:
                with timer.measure(name):
                    done = cache.decode(wanted)
                cache.note_time(done, timer.last_ms)
                spent += timer.last_ms
            if not (whole and wanted and cache.request_overflowed):
                break
        if in_bands:
            self._bands_left = BANDS
            return spent + self._sample_band(seen, target)
        with timer.measure(name):
            cache.sample(seen.visibility, self.context.scene_buffers, target, seen.anisotropy)
        return spent + timer.last_ms

    def _sample_band(self, seen: VisibilityInputs, target: AlbedoTarget) -> float:
        """Draw the next rows; the time in ms."""
        timer = self.context.timer
        band = (BANDS - self._bands_left, BANDS)
        self._bands_left -= 1
        with timer.measure("decode_cached"):
            self._tile_cache().sample(seen.visibility, self.context.scene_buffers, target, seen.anisotropy, band)
        return timer.last_ms

    def _textures_in(self, draw_list: DrawList) -> list[int]:
        """Encoded textures whose materials are drawn."""
        materials = self.context.scene.materials
        textures = {materials[index].texture_id for index in np.nonzero(draw_list.materials)[0]}
        return sorted(texture for texture in textures if texture >= 0 and self.decoders[texture] >= 0)

    def _decoders_in(self, draw_list: DrawList) -> list[int]:
        """Their decoders."""
        return sorted({self.decoders[texture] for texture in self._textures_in(draw_list)})

    def hand_over(self, pack: Pack, match: PackMatch) -> "GpuPack":
        """Another version of this pack in its place, which this frees. Decoded tiles of textures that are the same are kept.

        Raises GpuMemoryError where both do not fit beside each other; then this one is as it was.
        """
        made = GpuPack(self.context, pack, match, self.precision, self.programs)
        if self._cached is not None and same_shape(self.pack, pack) and self.match == match:
            changed = changed_textures(self.pack, pack)
            ids = [texture for texture, index in enumerate(match.texture_index) if index in changed]
            with self.context.context.memory.transaction():
                buffers, ranges = made.buffers, made._ranges
            self._cached.replace_pack(buffers, ranges, made.decoders, ids)
            made._cached, made._asked, made._ahead = self._cached, self._asked, self._ahead
            made._bands_left = self._bands_left
            self._made.remove(self._cached)
            made._made.append(made._cached)
        self.release()
        return made

    def make(self) -> None:
        """Have its buffers on the GPU, without latents. Raises GpuMemoryError."""
        _ = self.buffers

    @property
    def is_made(self) -> bool:
        """Whether its buffers are on the GPU."""
        return any(isinstance(part, PackBuffers) for part in self._made)

    def release(self) -> None:
        """Free everything."""
        for part in self._made:
            part.release()
        self._made.clear()
