"""The packs that a renderer's slots may name: how they fit the scene, and those of them that are on the GPU."""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from ntc.codec.maps import Plane, plane_channels
from ntc.codec.model import Pack
from ntc.pack.diff import same_shape
from ntc.pack.match import PackMatch
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.program import ProgramFactory
from viewer.render.divergence_overlay import CountedGrouping
from viewer.render.frame_result import UploadCounts
from viewer.render.gpu_pack import GpuPack, PackVersion, RenderContext
from viewer.render.tile_cache.budget import TileCounts
from viewer.state.pack_files import match_scene
from viewer.state.view_state import Precision, Slot, is_image_source


@contextmanager
def naming_memory_errors(name: str) -> Iterator[None]:
    """Put `name` before the message of a GpuMemoryError."""
    try:
        yield
    except GpuMemoryError as error:
        raise GpuMemoryError(f"{name}: {error}") from error


@dataclass(frozen=True, eq=False)
class OpenPack:
    """A pack that slots may name."""

    pack: Pack
    match: PackMatch
    version: int


class GpuPacks:
    """Packs of one scene. Each is uploaded when it is first asked for, once for every precision."""

    def __init__(self, context: RenderContext, programs: ProgramFactory) -> None:
        self._context, self._programs = context, programs
        self._open: dict[str, OpenPack] = {}
        self._last_version = 0
        self._grouping_versions: dict[tuple[int, ...], int] = {}
        self._on_gpu: dict[tuple[str, Precision], GpuPack] = {}

    def __contains__(self, name: str) -> bool:
        return name in self._open

    @property
    def matches(self) -> Mapping[str, PackMatch]:
        """How each pack fits the scene, by the pack's name."""
        return {name: opened.match for name, opened in self._open.items()}

    @property
    def is_updating(self) -> bool:
        """Whether `advance_updates` has something to upload."""
        return any(on_gpu.is_updating for on_gpu in self._on_gpu.values())

    def version(self, slot: Slot) -> int:
        """Number of the version of a pack that a slot shows: differs whenever its picture may."""
        on_gpu = self.uploaded(slot)
        return on_gpu.version if on_gpu is not None else self._open[slot.source].version

    def set_packs(self, packs: Mapping[str, Pack]) -> None:
        """The packs from now on. Those that are gone are freed; in those that are replaced what differs is uploaded at once."""
        for name in [name for name in self._open if name not in packs]:
            del self._open[name]
            self._release(name)
        changed = [name for name, pack in packs.items() if name not in self._open or self._open[name].pack is not pack]
        for name in changed:
            self.update_pack(name, packs[name])
        self._advance(changed, None)

    def update_pack(self, name: str, pack: Pack) -> None:
        """Open `pack`, or have it replace the one of that name: `advance_updates` uploads what differs.

        A pack of other textures, or another codec, is uploaded whole when it is drawn next.
        """
        before = self._open.get(name)
        if before is not None and before.pack is pack:
            return
        self._last_version += 1
        opened = self._open[name] = OpenPack(pack, match_scene(pack, self._context.scene), self._last_version)
        if before is None:
            return
        if not same_shape(before.pack, pack) or before.match != opened.match:
            self._release(name)
            return
        for on_gpu in [on_gpu for (source, _), on_gpu in self._on_gpu.items() if source == name]:
            on_gpu.update(PackVersion(pack, opened.version))

    def advance_updates(self, budget_bytes: int | None) -> UploadCounts:
        """Upload up to `budget_bytes` (None: all) of packs that replace others; each is drawn once all of it is there."""
        if not self.is_updating:
            return UploadCounts()
        with self._context.timer.measure("upload"):
            return self._advance(self._open, budget_bytes)

    def _advance(self, names: Collection[str], budget_bytes: int | None) -> UploadCounts:
        uploaded = kept = 0
        for (name, _), on_gpu in list(self._on_gpu.items()):
            room = None if budget_bytes is None else budget_bytes - uploaded
            if name not in names or not on_gpu.is_updating or (room is not None and room <= 0):
                continue
            try:
                counts = on_gpu.advance_update(room)
            except GpuMemoryError:
                # There is no memory for both beside each other: the new one is uploaded whole when it is drawn.
                self._release(name)
                continue
            uploaded, kept = uploaded + counts.uploaded, kept + counts.kept
        return UploadCounts(uploaded, kept, self.is_updating)

    def _release(self, name: str) -> None:
        for key in [key for key in self._on_gpu if key[0] == name]:
            self._on_gpu.pop(key).release()

    def holds(self, source: str, plane: Plane) -> bool:
        """Whether an open pack has maps of a plane."""
        config = self._open[source].pack.config
        return plane in plane_channels(config.maps, config.output_channels)

    def on_gpu(self, slot: Slot) -> GpuPack:
        """The pack that a slot shows, in its precision. Raises GpuMemoryError that names it."""
        key = (slot.source, slot.precision)
        if key not in self._on_gpu:
            opened = self._open[slot.source]
            with naming_memory_errors(f"pack {slot.source}"):
                self._on_gpu[key] = GpuPack(
                    self._context, opened.pack, opened.match, slot.precision, self._programs, opened.version
                )
        return self._on_gpu[key]

    def uploaded(self, slot: Slot) -> GpuPack | None:
        """The same, if it is on the GPU; None for images, too."""
        return self._on_gpu.get((slot.source, slot.precision))

    def tile_counts(self, slots: Iterable[Slot], skipped: Counter[str]) -> tuple[dict[Slot, TileCounts], str]:
        """Tile caches of those of `slots` that have one, and why latents of one are missing; "" where none are.

        Latents that no view has needed are added to `skipped`.
        """
        tiles, short_latents = {}, ""
        for slot in dict.fromkeys(slot for slot in slots if not is_image_source(slot.source)):
            on_gpu = self.on_gpu(slot)
            counts = on_gpu.tiles if slot.path == "cached" else None
            latents = on_gpu.buffers.latent_store.counts
            if counts is not None:
                tiles[slot] = counts
            coarse = counts is not None and counts.coarse_latents
            if latents.out_of_memory and (coarse or latents.levels_without_room > 0):
                short_latents = on_gpu.buffers.latent_store.refusal
            skipped["latent_bytes_not_uploaded"] += latents.bytes_left_out
            skipped["latent_textures_not_uploaded"] += latents.textures_left_out
        return tiles, short_latents

    def counted(self, source: str) -> CountedGrouping:
        """The grouping of a source, as divergence counts it; for images nothing is decoded."""
        opened = self._open.get(source)
        if opened is None:
            return CountedGrouping(0, (-1,) * len(self._context.scene.textures))
        decoders = opened.match.decoders(opened.pack)
        # A pack that is trained keeps its grouping: nothing is to be counted anew.
        version = self._grouping_versions.setdefault(decoders, len(self._grouping_versions) + 1)
        return CountedGrouping(version, decoders)

    def release(self) -> None:
        """Free everything on the GPU."""
        for name in list(self._open):
            self._release(name)
