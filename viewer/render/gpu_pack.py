"""A pack on the GPU in one precision: its buffers, the decode paths that read it, and the update that is under way."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import Plane
from ntc.codec.model import Pack
from ntc.pack.diff import changed_groups
from ntc.pack.match import PackMatch
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.gl.timer import PassTimer
from viewer.render.frame_result import UploadCounts
from viewer.render.passes.accumulate import AccumulatePass
from viewer.render.passes.decode_binned import DecodeBinnedPass
from viewer.render.passes.decode_deferred import DecodeDeferredPass
from viewer.render.passes.decode_forward import DecodeForwardPass
from viewer.render.passes.decode_pass import DecodePass
from viewer.render.passes.decode_sampled import DecodeSampledPass
from viewer.render.passes.visible_latents import NeededLevelsPass, VisibleLatentsPass
from viewer.render.resources.decoder_ranges import DecoderRanges
from viewer.render.resources.latent_store import LatentBudget
from viewer.render.resources.latent_update import LatentUpdate
from viewer.render.resources.pack_buffers import PackBuffers, codec_programs
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.visibility_buffer import PlaneReading
from viewer.render.tile_cache.budget import TileBudget, TileCacheConfig, TileCounts, total_counts
from viewer.render.tile_cache.cached_path import CachedPath
from viewer.render.tile_cache.decode_cached import DecodeCachedPass
from viewer.render.tile_cache.drawn_cache import DrawnTileCache
from viewer.render.tile_cache.tile_table import TileTable
from viewer.render.variants.choice import VariantChoice
from viewer.scene.model import Scene
from viewer.state.view_state import PathChoice, Precision, TexelFilter


@dataclass(frozen=True, eq=False)
class RenderContext:
    """What all packs of a renderer share."""

    graphics: GraphicsContext
    scene: Scene
    scene_buffers: SceneBuffers
    timer: PassTimer
    tile_cache: TileCacheConfig
    tile_budget: TileBudget
    latents: LatentBudget | None
    """None: all latents of a pack are uploaded at once."""
    emulate_half: bool = False
    """Round in single precision what the driver cannot compute in halves: for tests and studies."""
    variants: VariantChoice = field(default_factory=VariantChoice)
    """How the decoding shaders of each pack are laid out."""


@dataclass(frozen=True, eq=False)
class PackMemory:
    """GPU memory of one pack in one precision, as one decode path uses it."""

    parts: Mapping[str, int]
    """Bytes by what they are for: latents, decoders (with adapters), tables, tile cache."""
    idle: int
    """Bytes of other decode paths, which are kept so that they can be switched to at once; not among the parts."""
    latents: NDArray[np.int64]
    """[textures of the scene] int64: bytes of each texture's latents."""

    @property
    def total(self) -> int:
        """Bytes of all parts: what the path uses."""
        return sum(self.parts.values())


@dataclass(frozen=True, eq=False)
class PackVersion:
    """A pack that replaces another one of the same textures."""

    pack: Pack
    number: int
    """Differs from that of every other pack of the renderer."""


@dataclass(frozen=True, eq=False)
class PackUpdate:
    """The upload of a version, under way."""

    version: PackVersion
    stored: Pack
    """As the buffers store it."""
    groups: frozenset[int]
    """That differ from what the buffers hold."""
    latents: LatentUpdate


Decoder = DecodePass | DecodeSampledPass | CachedPath
"""What draws a plane of a pack."""


class GpuPack:
    """Buffers and decode paths of one pack. Paths are made when they are first used."""

    def __init__(
        self,
        context: RenderContext,
        pack: Pack,
        match: PackMatch,
        precision: Precision,
        programs: ProgramFactory,
        version: int,
    ) -> None:
        """`programs` are those of the scene. Raises GpuMemoryError."""
        self.context, self.pack, self.match = context, pack, match
        self._variant = context.variants.variant(context.graphics, pack, precision)
        self.programs = codec_programs(programs, pack, self._variant)
        self.version = version
        """Number of the version that is drawn; `pack` is that version."""
        self.buffers = PackBuffers(
            context.graphics,
            pack,
            match.texture_index,
            precision,
            context.emulate_half,
            self._variant,
            on_demand=context.latents,
        )
        self._precision = precision
        self._ranges: DecoderRanges | None = None
        self._latents: dict[Plane, VisibleLatentsPass] = {}
        self._passes: dict[tuple[PathChoice, TexelFilter, Plane], DecodePass | DecodeSampledPass] = {}
        """Of the paths that decode every pixel."""
        self._caches: dict[Plane, CachedPath] = {}
        self._next: PackVersion | None = None
        """Waits until the update under way is done."""
        self._update: PackUpdate | None = None

    def reading(self, plane: Plane = "base") -> PlaneReading:
        """How passes read the scene's surfaces for a plane of their maps."""
        buffers = self.context.scene_buffers
        return PlaneReading(plane, buffers.has_colors, buffers.has_second_uvs)

    @property
    def tiles(self) -> TileCounts | None:
        """The state of the tile caches, of all planes together; None where there is none."""
        return total_counts([cache.tiles for cache in self._caches.values()])

    @property
    def ranges(self) -> DecoderRanges:
        """Each decoder as a buffer range of its own; made when first asked for."""
        if self._ranges is None:
            self._ranges = DecoderRanges(self.context.graphics, self.pack, self._precision, self._variant)
        return self._ranges

    def decoder(self, name: PathChoice, texel_filter: TexelFilter = "exact", plane: Plane = "base") -> Decoder:
        """What draws a plane that the pack holds by a path, not `auto`, with a filter that it has; made when it is first asked for.

        Raises GpuMemoryError, ShaderError.
        """
        if name == "cached":
            if plane not in self._caches:
                self._caches[plane] = _cached(self, plane)
            return self._caches[plane]
        key = (name, texel_filter, plane)
        if key not in self._passes:
            made = DECODE_PASSES[name](self, texel_filter, plane)
            graphics = self.context.graphics
            is_exact = texel_filter == "exact"
            self._passes[key] = made if is_exact else DecodeSampledPass(made, AccumulatePass(graphics, self.programs))
        return self._passes[key]

    def latents(self, plane: Plane = "base") -> VisibleLatentsPass:
        """Uploads the mips that the pixels of a view read."""
        if plane not in self._latents:
            context, count = self.context, len(self.match.texture_index)
            make = partial(NeededLevelsPass, context.graphics, self.programs, count, self.reading(plane))
            found = make if context.graphics.features.compute else None
            self._latents[plane] = VisibleLatentsPass(found, self.buffers, context.graphics.waits)
        return self._latents[plane]

    def memory(self, name: PathChoice, texel_filter: TexelFilter) -> PackMemory:
        """What lies on the GPU, for those who draw with this path and filter."""
        parts = self.buffers.bytes_by_part
        of_passes = {key: own.bytes_on_gpu for key, own in self._passes.items()}
        of_caches = sum(cache.bytes_on_gpu for cache in self._caches.values())
        used = sum(size for key, size in of_passes.items() if key[:2] == (name, texel_filter))
        idle = sum(of_passes.values()) - used
        others = [("tile cache", of_caches)] if name == "cached" and self._caches else [("tables", used)]
        idle += 0 if name == "cached" else of_caches
        if self._ranges is not None:
            others.append(("decoders", self._ranges.bytes_on_gpu))
        others += [("tables", levels.bytes_on_gpu) for levels in self._latents.values()]
        for part, size in others:
            parts[part] = parts.get(part, 0) + size
        return PackMemory(parts, idle, self.buffers.latent_store.bytes_by_texture)

    @property
    def is_updating(self) -> bool:
        """Whether a newer version is on its way; the older one is drawn until it is there whole."""
        return self._update is not None or self._next is not None

    def update(self, version: PackVersion) -> None:
        """Replace the pack by a version of the same textures and codec, which `advance_update` uploads."""
        self._next = version

    def advance_update(self, budget_bytes: int | None) -> UploadCounts:
        """Upload up to `budget_bytes` (None: all) of the newer version, and draw it from now on once all is there.

        Raises GpuMemoryError; the pack must then be released.
        """
        uploaded = kept = 0
        while self.is_updating:
            update = self._update = self._update or self._begin_update()
            missing = update.latents.missing_bytes
            if budget_bytes is not None and missing + self._weight_bytes(update) > budget_bytes and missing > 0:
                return UploadCounts(update.latents.stage(budget_bytes), is_pending=True)
            done = self._finish_update(update)
            uploaded, kept = uploaded + done.uploaded, done.kept
            self._update = None
            if budget_bytes is not None:
                break
        return UploadCounts(uploaded, kept, self.is_updating)

    def _weight_bytes(self, update: PackUpdate) -> int:
        """About how many bytes the decoders and adapters of the changed groups have."""
        decoders = max(1, len(update.stored.decoders))
        return self.buffers.bytes_by_part["decoders"] * len(update.groups) // decoders

    def _begin_update(self) -> PackUpdate:
        version, self._next = self._next, None
        assert version is not None
        # Whether halves are rescaled depends on all groups: what is stored is compared.
        stored = self.buffers.stored(version.pack)
        groups = changed_groups(self.buffers.pack, stored)
        slots = self.buffers.slots_of_groups(groups, stored)
        return PackUpdate(version, stored, groups, LatentUpdate(self.buffers.latent_store, slots))

    def _finish_update(self, update: PackUpdate) -> UploadCounts:
        """Upload what is left, and draw this version from now on."""
        stored, groups = update.stored, update.groups
        regrouped = [t.group for t in self.pack.textures] != [t.group for t in stored.textures]
        uploaded = self.buffers.replace_weights(stored, groups)
        if self._ranges is not None:
            # Decoders that did not change may have other numbers.
            uploaded += self._ranges.replace(stored, range(len(stored.decoders)) if regrouped else groups)
        latent_bytes = self.buffers.latent_store.bytes_by_texture
        textures = self.buffers.slots_of_groups(groups, stored)
        kept = int(latent_bytes.sum() - latent_bytes[list(textures)].sum())
        kept += self.buffers.bytes_by_part["decoders"] - self._weight_bytes(update)
        uploaded += update.latents.apply()
        if not update.latents.fits:
            self.buffers.note_latents()
        self.pack, self.version = update.version.pack, update.version.number
        for cache in self._caches.values():
            cache.mark_stale(textures)
        if regrouped:
            # Passes depend on which decoders there are.
            self._release_passes()
        return UploadCounts(uploaded, kept)

    def _release_passes(self) -> None:
        for own in self._passes.values():
            own.release()
        self._passes.clear()

    def release(self) -> None:
        """Free everything."""
        if self._update is not None:
            self._update.latents.release()
        self._update = self._next = None
        self._release_passes()
        for part in (*self._caches.values(), self._ranges, *self._latents.values(), self.buffers):
            if part is not None:
                part.release()
        self._caches.clear()


def _forward(pack: GpuPack, texel_filter: TexelFilter, plane: Plane) -> DecodePass:
    graphics, scene_buffers = pack.context.graphics, pack.context.scene_buffers
    return DecodeForwardPass(graphics, pack.programs, pack.buffers, scene_buffers, pack.reading(plane), texel_filter)


def deferred_pass(
    pack: GpuPack, texel_filter: TexelFilter = "exact", plane: Plane = "base", may_share: bool = True
) -> DecodePass:
    """Decode path `deferred`. Without `may_share` every pixel has a decoder index, even where all have one: for benchmarks."""
    used = {decoder for decoder in pack.match.decoders(pack.pack) if decoder >= 0}
    shared = used.pop() if may_share and len(used) == 1 else None
    ranges = pack.ranges if shared is not None else None
    return DecodeDeferredPass(
        pack.context.graphics, pack.programs, pack.buffers, ranges, pack.reading(plane), shared, texel_filter
    )


def binned_pass(pack: GpuPack, texel_filter: TexelFilter = "exact", plane: Plane = "base") -> DecodePass:
    """Decode path `binned`."""
    graphics, reading = pack.context.graphics, pack.reading(plane)
    return DecodeBinnedPass(graphics, pack.programs, pack.buffers, pack.ranges, reading, texel_filter)


def _cached(pack: GpuPack, plane: Plane) -> CachedPath:
    context = pack.context
    kind = DecodeCachedPass if context.graphics.features.compute else DrawnTileCache
    cache = kind(
        context.graphics,
        pack.programs,
        pack.buffers,
        pack.ranges,
        TileTable.of(context.scene.materials, pack.pack, pack.match, plane),
        pack.reading(plane),
        context.tile_cache,
        context.tile_budget,
    )
    return CachedPath(cache, context.timer, context.tile_budget)


DECODE_PASSES: Mapping[PathChoice, Callable[[GpuPack, TexelFilter, Plane], DecodePass]] = {
    "forward": _forward,
    "deferred": deferred_pass,
    "binned": binned_pass,
}
"""How the paths that decode every pixel are made for a pack."""
