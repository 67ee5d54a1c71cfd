"""Open packs of a renderer, and their buffers, decode paths and updates on the GPU."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial, reduce

from ntc.codec.maps import Plane, plane_channels
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.pack.match import PackMatch, changed_groups, changed_textures, same_shape
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.render.frames import PackMemory, UploadCounts
from viewer.render.passes.decode import (
    DecodeBinnedPass,
    DecodeDeferredPass,
    DecodeForwardPass,
    DecodePass,
    DecodePlanesPass,
    DecodeSampledPass,
)
from viewer.render.passes.decode_cached import DecodeCachedPass
from viewer.render.passes.load_textures import LoadCounts, LoadedTextures
from viewer.render.passes.reference import ReferencePass
from viewer.render.passes.visible_latents import VisibleLatentsPass
from viewer.render.render_context import RenderContext
from viewer.render.resources.accumulator import Accumulator
from viewer.render.resources.coverage import PackedCoverage, packed_coverage
from viewer.render.resources.decoding_shaders import decoder_variant
from viewer.render.resources.divergence_maps import CountedGrouping
from viewer.render.resources.latent_store import LatentUpdate
from viewer.render.resources.load_plan import LoadPlan
from viewer.render.resources.pack_buffers import DecoderRanges, PackBuffers, codec_programs
from viewer.render.resources.tile_cache.budget import TileCounts, total_counts
from viewer.render.resources.tile_cache.cache import TileCache
from viewer.render.resources.tile_cache.tiles import TileTable
from viewer.render.resources.visibility_buffer import PlaneReading
from viewer.state.pack_files import match_scene
from viewer.state.view_state import PathChoice, Precision, Slot, TexelFilter, is_image_source


@dataclass(frozen=True, eq=False)
class OpenPack:
    """A pack that slots may name, in one of its versions."""

    pack: Pack
    match: PackMatch
    version: int
    """Number that no other pack of the renderer has."""
    coverage: Mapping[int, PackedCoverage] = field(default_factory=dict)
    """Coverage by texture id of the scene; textures without the map `alpha` are absent."""


@dataclass(frozen=True, eq=False)
class PackUpdate:
    """Unfinished upload of a newer version of a pack."""

    opened: OpenPack
    stored: Pack
    """Pack as the buffers store it."""
    groups: frozenset[int]
    """Groups that differ from the pack in the buffers."""
    latents: LatentUpdate


def on_load_refusal(context: GraphicsContext) -> str:
    """Return the reason why a driver without compute shaders cannot compress textures."""
    version = context.info.version
    return f"needs compute shaders and BC7 (OpenGL 4.3); this driver has {version}. Use cached: it filters the same way"


PixelDecoder = DecodePass | DecodeSampledPass
"""Pass that decodes every visible pixel in each frame."""


class GpuPack:
    """Buffers and decode paths of one pack. Paths are made when they are first used."""

    def __init__(self, context: RenderContext, opened: OpenPack, precision: Precision) -> None:
        """Upload the pack. Raises GpuMemoryError."""
        pack, match = opened.pack, opened.match
        self.context, self.pack, self.match = context, pack, match
        self._variant = decoder_variant(context.graphics, context.variant)
        self.programs = codec_programs(context.programs, pack, self._variant)
        self.version = opened.version
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
        self._passes: dict[tuple[PathChoice, TexelFilter, Plane | None], PixelDecoder] = {}
        """Passes of the paths that decode every pixel."""
        self._caches: dict[Plane, DecodeCachedPass] = {}
        self._loaded: dict[Plane, ReferencePass[LoadedTextures]] = {}
        self._next: OpenPack | None = None
        """Version that waits until the current update is done."""
        self._update: PackUpdate | None = None

    def reading(self, plane: Plane = "base", has_several: bool = False) -> PlaneReading:
        """Return the settings with which passes read surfaces for one plane of maps, or for several."""
        buffers = self.context.scene_buffers
        return PlaneReading(plane, buffers.has_colors, buffers.has_second_uvs, has_several)

    @property
    def tiles(self) -> TileCounts | None:
        """State of the tile caches of all planes together; None without a cache."""
        return total_counts([cache.tiles for cache in self._caches.values()])

    @property
    def loads(self) -> LoadCounts | None:
        """State of the compressed textures of all planes together; None without path `on-load`."""
        counts = [path.uploads.counts for path in self._loaded.values()]
        return reduce(LoadCounts.plus, counts) if counts else None

    def measure_loads(self) -> None:
        """Read the compression errors that `loads` reports. Waits for the GPU."""
        for path in self._loaded.values():
            path.uploads.measure()

    @property
    def ranges(self) -> DecoderRanges:
        """Buffer ranges of the decoders, one for each; made when first asked for."""
        if self._ranges is None:
            self._ranges = DecoderRanges(self.context.graphics, self.pack, self._precision, self._variant)
        return self._ranges

    def cached(self, plane: Plane) -> DecodeCachedPass:
        """Return path `cached` of a plane; made when first asked for. Raises GpuMemoryError, ShaderError."""
        if plane not in self._caches:
            context = self.context
            self._caches[plane] = DecodeCachedPass(self.tile_cache(plane), context.scheduler.timer, context.tile_budget)
        return self._caches[plane]

    def on_load(self, plane: Plane) -> ReferencePass[LoadedTextures]:
        """Return path `on-load` of a plane; made when first asked for. Raises GpuMemoryError, ShaderError, InputError."""
        if plane not in self._loaded:
            self._loaded[plane] = self._on_load(plane)
        return self._loaded[plane]

    def decoder(self, name: PathChoice, texel_filter: TexelFilter, plane: Plane | None) -> PixelDecoder:
        """Return the pass of a path that decodes every pixel, for one plane of the pack; made when first asked for.

        `plane` None: for all planes, if the path `decodes_planes`. Raises GpuMemoryError, ShaderError.
        """
        key = (name, texel_filter, plane)
        if key not in self._passes:
            made = planes_pass(self, texel_filter) if plane is None else DECODE_PASSES[name](self, texel_filter, plane)
            accumulate = partial(Accumulator, self.context.graphics, self.programs)
            self._passes[key] = made if texel_filter == "exact" else DecodeSampledPass(made, accumulate)
        return self._passes[key]

    def decodes_planes(self, name: PathChoice) -> bool:
        """Return whether one pass of this path decodes all planes at once."""
        return name == "deferred" and self.buffers.decodes_together

    def tile_cache(self, plane: Plane = "base") -> TileCache:
        """Make a tile cache of path `cached` for a plane, which the caller releases. Raises GpuMemoryError, ShaderError."""
        context, graphics = self.context, self.context.graphics
        table, reading = TileTable.of(context.scene.materials, self.pack, self.match, plane), self.reading(plane)
        return TileCache(graphics, self.programs, self.buffers, self.ranges, table, reading, context.tile_budget)

    def _on_load(self, plane: Plane) -> ReferencePass[LoadedTextures]:
        if not self.context.graphics.features.compute:
            raise InputError(f"path on-load {on_load_refusal(self.context.graphics)}")
        context, graphics, reading = self.context, self.context.graphics, self.reading(plane)
        plan = LoadPlan.of(context.scene.materials, self.pack, self.match, plane)
        shared = (context.scheduler.timer, context.tile_budget)
        textures = LoadedTextures(graphics, self.programs, self.buffers, self.ranges, plan, reading, *shared)
        return ReferencePass(graphics, self.programs, textures, "decode_on-load", reading)

    def latents(self, plane: Plane = "base") -> VisibleLatentsPass:
        """Return the pass that uploads the mips that the visible pixels read."""
        if plane not in self._latents:
            reading = self.reading(plane)
            self._latents[plane] = VisibleLatentsPass(self.context.graphics, self.programs, self.buffers, reading)
        return self._latents[plane]

    def memory(self, name: PathChoice, texel_filter: TexelFilter) -> PackMemory:
        """Return the GPU memory of the pack, as drawing with this path and filter uses it."""
        parts = self.buffers.bytes_by_part
        of_passes = {key: decode_pass.bytes_on_gpu for key, decode_pass in self._passes.items()}
        if name == "on-load" and self._loaded:
            # Only other paths, and textures not compressed yet, read latents and decoders.
            idle = (
                sum(parts.values())
                + sum(of_passes.values())
                + sum(path.cache.bytes_on_gpu for path in self._caches.values())
            )
            idle += 0 if self._ranges is None else self._ranges.bytes_on_gpu
            textures = sum(path.uploads.texture_bytes for path in self._loaded.values())
            working = sum(path.uploads.bytes_on_gpu for path in self._loaded.values()) - textures
            return PackMemory(
                {"compressed textures": textures, "tables": working}, idle, self.buffers.latent_store.bytes_by_texture
            )
        of_caches = sum(path.cache.bytes_on_gpu for path in self._caches.values())
        used = sum(size for key, size in of_passes.items() if key[:2] == (name, texel_filter))
        idle = sum(of_passes.values()) - used
        others = [("tile cache", of_caches)] if name == "cached" and self._caches else [("tables", used)]
        idle += 0 if name == "cached" else of_caches
        idle += sum(path.uploads.bytes_on_gpu for path in self._loaded.values())
        if self._ranges is not None:
            others.append(("decoders", self._ranges.bytes_on_gpu))
        others += [("tables", levels.bytes_on_gpu) for levels in self._latents.values()]
        for part, size in others:
            parts[part] = parts.get(part, 0) + size
        return PackMemory(parts, idle, self.buffers.latent_store.bytes_by_texture)

    @property
    def is_updating(self) -> bool:
        """True while a newer version is uploaded; the older one is drawn until then."""
        return self._update is not None or self._next is not None

    def update(self, opened: OpenPack) -> None:
        """Schedule the upload of a newer version of the same textures and codec; `advance_update` uploads it."""
        self._next = opened

    def advance_update(self, budget_bytes: int | None) -> UploadCounts:
        """Upload up to `budget_bytes` (None: all) of the newer version, and switch to it when it is complete.

        Raises GpuMemoryError; the pack must then be released.
        """
        uploaded = unchanged = 0
        while self.is_updating:
            update = self._update = self._update or self._begin_update()
            missing = update.latents.missing_bytes
            if budget_bytes is not None and missing + self._weight_bytes(update) > budget_bytes and missing > 0:
                return UploadCounts(update.latents.stage(budget_bytes), is_pending=True)
            done = self._finish_update(update)
            uploaded, unchanged = uploaded + done.uploaded, done.unchanged
            self._update = None
            if budget_bytes is not None:
                break
        return UploadCounts(uploaded, unchanged, self.is_updating)

    def _weight_bytes(self, update: PackUpdate) -> int:
        """Return the approximate number of bytes of the decoders and adapters of the changed groups."""
        decoders = max(1, len(update.stored.decoders))
        return self.buffers.bytes_by_part["decoders"] * len(update.groups) // decoders

    def _begin_update(self) -> PackUpdate:
        opened, self._next = self._next, None
        assert opened is not None
        # Whether halves are rescaled depends on all groups, so the rescaled packs are compared.
        stored = self.buffers.stored(opened.pack)
        groups = changed_groups(self.buffers.pack, stored)
        slots = self.buffers.slots_of_groups(groups, stored)
        return PackUpdate(opened, stored, groups, LatentUpdate(self.buffers.latent_store, slots))

    def _finish_update(self, update: PackUpdate) -> UploadCounts:
        """Upload the rest, and switch to this version."""
        stored, groups = update.stored, update.groups
        regrouped = [t.group for t in self.pack.textures] != [t.group for t in stored.textures]
        uploaded = self.buffers.replace_weights(stored, groups)
        if self._ranges is not None:
            # Unchanged decoders may have other numbers.
            uploaded += self._ranges.replace(stored, range(len(stored.decoders)) if regrouped else groups)
        latent_bytes = self.buffers.latent_store.bytes_by_texture
        textures = self.buffers.slots_of_groups(groups, stored)
        unchanged = int(latent_bytes.sum() - latent_bytes[list(textures)].sum())
        unchanged += self.buffers.bytes_by_part["decoders"] - self._weight_bytes(update)
        uploaded += update.latents.apply()
        if not update.latents.fits:
            self.buffers.note_latents()
        self.pack, self.version = update.opened.pack, update.opened.version
        for path in self._caches.values():
            path.cache.mark_stale(textures)
        for loaded in self._loaded.values():
            loaded.uploads.mark_stale(textures)
        if regrouped:
            # Programs depend on the set of decoders.
            self._release_passes()
        return UploadCounts(uploaded, unchanged)

    def _release_passes(self) -> None:
        for decode_pass in self._passes.values():
            decode_pass.release()
        self._passes.clear()

    def release(self) -> None:
        """Free everything."""
        if self._update is not None:
            self._update.latents.release()
        self._update = self._next = None
        self._release_passes()
        caches = [path.cache for path in self._caches.values()]
        for part in (*caches, *self._loaded.values(), self._ranges, *self._latents.values(), self.buffers):
            if part is not None:
                part.release()
        self._caches.clear()
        self._loaded.clear()


def _forward(pack: GpuPack, texel_filter: TexelFilter, plane: Plane) -> DecodePass:
    graphics, scene_buffers = pack.context.graphics, pack.context.scene_buffers
    return DecodeForwardPass(graphics, pack.programs, pack.buffers, scene_buffers, pack.reading(plane), texel_filter)


def deferred_pass(
    pack: GpuPack, texel_filter: TexelFilter = "exact", plane: Plane = "base", may_share: bool = True
) -> DecodePass:
    """Return the pass of path `deferred`. With `may_share`, a single decoder is bound for all pixels."""
    used = {decoder for decoder in pack.match.decoders(pack.pack) if decoder >= 0}
    shared = used.pop() if may_share and len(used) == 1 else None
    ranges = pack.ranges if shared is not None else None
    return DecodeDeferredPass(
        pack.context.graphics, pack.programs, pack.buffers, ranges, pack.reading(plane), shared, texel_filter
    )


def planes_pass(pack: GpuPack, texel_filter: TexelFilter = "exact") -> DecodePass:
    """Return the pass of path `deferred` that decodes all planes at once, for a pack whose work groups decode codes together."""
    plane_pass, graphics = partial(deferred_pass, pack, texel_filter), pack.context.graphics
    reading = pack.reading(has_several=True)
    return DecodePlanesPass(graphics, pack.programs, pack.buffers, reading, plane_pass, texel_filter)


def binned_pass(pack: GpuPack, texel_filter: TexelFilter = "exact", plane: Plane = "base") -> DecodePass:
    """Return the pass of path `binned`."""
    graphics, reading = pack.context.graphics, pack.reading(plane)
    return DecodeBinnedPass(graphics, pack.programs, pack.buffers, pack.ranges, reading, texel_filter)


DECODE_PASSES: Mapping[PathChoice, Callable[[GpuPack, TexelFilter, Plane], DecodePass]] = {
    "forward": _forward,
    "deferred": deferred_pass,
    "binned": binned_pass,
}
"""Constructors of the passes that decode every pixel, by path."""


@contextmanager
def naming_memory_errors(name: str) -> Iterator[None]:
    """Put `name` before the message of a GpuMemoryError of the block."""
    try:
        yield
    except GpuMemoryError as error:
        raise GpuMemoryError(f"{name}: {error}") from error


class GpuPacks:
    """Open packs of one scene. A pack is uploaded when a slot first draws it, once in each precision."""

    def __init__(self, context: RenderContext) -> None:
        self._context = context
        self._open: dict[str, OpenPack] = {}
        self._last_version = 0
        self._grouping_versions: dict[tuple[int, ...], int] = {}
        self._on_gpu: dict[tuple[str, Precision], GpuPack] = {}

    def __contains__(self, name: str) -> bool:
        return name in self._open

    @property
    def matches(self) -> Mapping[str, PackMatch]:
        """Match of each pack with the scene, by the pack's name."""
        return {name: opened.match for name, opened in self._open.items()}

    @property
    def is_updating(self) -> bool:
        """True while a newer version of a pack waits for `advance_updates`."""
        return any(on_gpu.is_updating for on_gpu in self._on_gpu.values())

    def version(self, slot: Slot) -> int:
        """Return the version of the pack that a slot shows; it changes whenever the picture may change."""
        on_gpu = self.uploaded(slot)
        return on_gpu.version if on_gpu is not None else self._open[slot.source].version

    def set_packs(self, packs: Mapping[str, Pack]) -> None:
        """Replace the open packs. Absent packs are freed; differences of replaced packs are uploaded at once."""
        for name in [name for name in self._open if name not in packs]:
            del self._open[name]
            self._release(name)
        self._take_coverage()
        changed = [name for name, pack in packs.items() if name not in self._open or self._open[name].pack is not pack]
        for name in changed:
            self.update_pack(name, packs[name])
        self._advance(changed, None)

    def update_pack(self, name: str, pack: Pack) -> None:
        """Open `pack`, or replace the open pack of that name; `advance_updates` uploads the differences.

        A pack of other textures, or of another codec, is uploaded whole when it is drawn next.
        """
        before = self._open.get(name)
        if before is not None and before.pack is pack:
            return
        self._last_version += 1
        match = match_scene(pack, self._context.scene)
        coverage = packed_coverage(pack, match)
        is_newer = before is not None and same_shape(before.pack, pack) and before.match == match
        if before is not None and is_newer and coverage:
            changed = changed_textures(before.pack, pack)
            coverage |= {number: packed for number, packed in before.coverage.items() if packed.index not in changed}
        opened = self._open[name] = OpenPack(pack, match, self._last_version, coverage)
        self._take_coverage()
        if not is_newer:
            self._release(name)
        for on_gpu in [on_gpu for (source, _), on_gpu in self._on_gpu.items() if source == name]:
            on_gpu.update(opened)

    def _take_coverage(self) -> None:
        """Take each texture's coverage from the first open pack that holds its map `alpha`."""
        covered = dict[int, PackedCoverage]()
        for opened in self._open.values():
            covered = {**opened.coverage, **covered}
        self._context.scene_buffers.take_coverage(covered)

    def advance_updates(self, budget_bytes: int | None) -> UploadCounts:
        """Upload up to `budget_bytes` (None: all) of newer versions; each is drawn as soon as it is complete."""
        if not self.is_updating:
            return UploadCounts()
        with self._context.scheduler.timer.measure("upload"):
            return self._advance(self._open, budget_bytes)

    def _advance(self, names: Collection[str], budget_bytes: int | None) -> UploadCounts:
        uploaded = unchanged = 0
        for (name, _), on_gpu in list(self._on_gpu.items()):
            room = None if budget_bytes is None else budget_bytes - uploaded
            if name not in names or not on_gpu.is_updating or (room is not None and room <= 0):
                continue
            try:
                counts = on_gpu.advance_update(room)
            except GpuMemoryError:
                # The GPU has no memory for both versions, so the new one is uploaded whole when it is drawn.
                self._release(name)
                continue
            uploaded, unchanged = uploaded + counts.uploaded, unchanged + counts.unchanged
        return UploadCounts(uploaded, unchanged, self.is_updating)

    def _release(self, name: str) -> None:
        for key in [key for key in self._on_gpu if key[0] == name]:
            self._on_gpu.pop(key).release()

    def holds(self, source: str, plane: Plane) -> bool:
        """Return whether an open pack has maps of a plane."""
        config = self._open[source].pack.config
        return plane in plane_channels(config.maps, config.output_channels)

    def shares_decoders(self, source: str) -> bool:
        """Return whether decoders of an open pack have weights, which pixels of one decoder fetch together."""
        config = self._open[source].pack.config
        return codec_of(config).gpu_tables(config).shares_decoders

    def on_gpu(self, slot: Slot) -> GpuPack:
        """Return the pack that a slot shows, in its precision; uploaded when first asked for. Raises GpuMemoryError that names it."""
        key = (slot.source, slot.precision)
        if key not in self._on_gpu:
            with naming_memory_errors(f"pack {slot.source}"):
                self._on_gpu[key] = GpuPack(self._context, self._open[slot.source], slot.precision)
        return self._on_gpu[key]

    def uploaded(self, slot: Slot) -> GpuPack | None:
        """Return the pack that a slot shows if it is on the GPU; None for others and for images."""
        return self._on_gpu.get((slot.source, slot.precision))

    def load_counts(self, slots: Iterable[Slot], skipped: Counter[str]) -> dict[Slot, LoadCounts]:
        """Return counts of the compressed textures of the `on-load` slots; uncompressed textures and mips are added to `skipped`."""
        loads = {}
        for slot in dict.fromkeys(
            slot for slot in slots if slot.path == "on-load" and not is_image_source(slot.source)
        ):
            counts = self.on_gpu(slot).loads
            if counts is not None:
                loads[slot] = counts
                skipped["textures_not_compressed"] += counts.left_out
                skipped["mips_not_compressed"] += counts.mips_left_out
        return loads

    def tile_counts(self, slots: Iterable[Slot], skipped: Counter[str]) -> tuple[dict[Slot, TileCounts], str]:
        """Return the tile counts of the `cached` slots, and the reason why latents are missing ("" if none are).

        Latents that no view has needed yet are added to `skipped`.
        """
        tiles, short_latents = {}, ""
        for slot in dict.fromkeys(slot for slot in slots if not is_image_source(slot.source)):
            on_gpu = self.on_gpu(slot)
            counts = on_gpu.tiles if slot.path == "cached" else None
            latents = on_gpu.buffers.latent_store.counts
            if counts is not None:
                tiles[slot] = counts
            coarse = counts is not None and counts.coarse_latents
            if slot.path == "on-load":
                coarse = on_gpu.loads is not None and on_gpu.loads.coarse_latents
            if latents.out_of_memory and (coarse or latents.levels_without_room > 0):
                short_latents = on_gpu.buffers.latent_store.refusal
            skipped["latent_bytes_not_uploaded"] += latents.bytes_left_out
            skipped["latent_textures_not_uploaded"] += latents.textures_left_out
        return tiles, short_latents

    def counted(self, source: str) -> CountedGrouping:
        """Return the grouping of a source for counting; images have decoder -1 everywhere."""
        opened = self._open.get(source)
        if opened is None:
            return CountedGrouping(0, (-1,) * len(self._context.scene.textures))
        decoders = opened.match.decoders(opened.pack)
        # Training keeps the grouping, so equal decoders have the same version and are not counted again.
        version = self._grouping_versions.setdefault(decoders, len(self._grouping_versions) + 1)
        return CountedGrouping(version, decoders)

    def release(self) -> None:
        """Free everything on the GPU."""
        for name in list(self._open):
            self._release(name)
