"""The packs that a renderer's slots may name: how they fit the scene, and those of them that are on the GPU."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from ntc.codec.config import CodecConfig
from ntc.pack.match import PackMatch
from ntc.pack.model import Pack
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.program import ProgramFactory
from viewer.render.divergence_overlay import CountedGrouping
from viewer.render.gpu_pack import GpuPack, RenderContext
from viewer.render.resources.pack_buffers import codec_programs
from viewer.scene.model import Scene
from viewer.state.pack_files import match_scene
from viewer.state.view_state import Precision, Slot


@contextmanager
def naming_memory_errors(name: str) -> Iterator[None]:
    """Say what it is that the GPU has no memory for."""
    try:
        yield
    except GpuMemoryError as error:
        raise GpuMemoryError(f"{name}: {error}") from error


class GpuPacks:
    """Packs of one scene. Each is uploaded when it is first asked for, once for every precision."""

    def __init__(self, context: RenderContext, programs: ProgramFactory, scene: Scene) -> None:
        self._drawing, self._programs, self._scene = context, programs, scene
        self._packs: dict[str, Pack] = {}
        self._versions: dict[str, int] = {}
        self._last_version = 0
        self._grouping_versions: dict[tuple[int, ...], int] = {}
        self._matches: dict[str, PackMatch] = {}
        self._on_gpu: dict[tuple[str, Precision], GpuPack] = {}
        self._codec_programs: dict[CodecConfig, ProgramFactory] = {}

    def __contains__(self, name: str) -> bool:
        return name in self._packs

    @property
    def matches(self) -> Mapping[str, PackMatch]:
        """How each pack fits the scene, by the pack's name."""
        return self._matches

    def version(self, name: str) -> int:
        """Of a pack: differs whenever another one takes its name."""
        return self._versions[name]

    def set_packs(self, packs: Mapping[str, Pack]) -> None:
        """The packs from now on. Those that are gone or replaced are freed."""
        for name, pack in packs.items():
            if self._packs.get(name) is not pack:
                self._last_version += 1
                self._versions[name] = self._last_version
                self._matches[name] = match_scene(pack, self._scene)
        for key, on_gpu in list(self._on_gpu.items()):
            replaced = packs.get(key[0])
            if replaced is None or replaced.config != on_gpu.pack.config:
                self._on_gpu.pop(key).release()
            elif replaced is not on_gpu.pack:
                try:
                    self._on_gpu[key] = on_gpu.hand_over(replaced, self._matches[key[0]])
                except GpuMemoryError:
                    # Both do not fit beside each other; the new one is made when it is drawn.
                    self._on_gpu.pop(key).release()
        self._matches = {name: match for name, match in self._matches.items() if name in packs}
        self._packs = dict(packs)

    def on_gpu(self, slot: Slot) -> GpuPack:
        """The pack that a slot shows, in its precision. Raises GpuMemoryError that names it."""
        key = (slot.source, slot.precision)
        if key not in self._on_gpu:
            pack = self._packs[slot.source]
            # Packs of one codec share their programs: those take seconds to compile.
            if pack.config not in self._codec_programs:
                self._codec_programs[pack.config] = codec_programs(self._programs, pack)
            programs = self._codec_programs[pack.config]
            on_gpu = GpuPack(self._drawing, pack, self._matches[slot.source], slot.precision, programs)
            with naming_memory_errors(f"pack {slot.source}"):
                on_gpu.make()
            self._on_gpu[key] = on_gpu
        return self._on_gpu[key]

    def uploaded(self, slot: Slot) -> GpuPack | None:
        """The same, if it is on the GPU; None for the reference, too."""
        return self._on_gpu.get((slot.source, slot.precision))

    def counted(self, source: str) -> CountedGrouping:
        """The grouping of a source, as divergence counts it; for the reference nothing is decoded."""
        pack = self._packs.get(source)
        if pack is None:
            return CountedGrouping(0, (-1,) * len(self._scene.textures))
        decoders = tuple(self._matches[source].decoders(pack))
        # A pack that is trained keeps its grouping: nothing is to be counted anew.
        version = self._grouping_versions.setdefault(decoders, len(self._grouping_versions) + 1)
        return CountedGrouping(version, decoders)

    def release(self) -> None:
        """Free everything on the GPU."""
        for on_gpu in self._on_gpu.values():
            on_gpu.release()
        self._on_gpu.clear()
        for programs in self._codec_programs.values():
            programs.release()
