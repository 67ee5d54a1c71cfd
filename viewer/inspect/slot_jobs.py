"""Background jobs that slots wait for: encoding textures in a block format, and the search for the fastest precision."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from ntc.codec.codec import ChosenPrecision
from ntc.codec.config import Precision
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from ntc.metrics.block_compression import BlockFormat
from ntc.metrics.compressed_textures import CompressedTextures, cached_texture, compress_texture
from ntc.worker.helpers import HELPERS
from viewer.jobs.job import Background, JobReport
from viewer.scene.map_pictures import compressed_scene, compression_requests
from viewer.scene.model import Scene
from viewer.state.events import EmitEvent, Notification, PrecisionChosen, TexturesCompressed
from viewer.state.message_log import details_of
from viewer.state.session import Session
from viewer.state.view_state import REFERENCE

Key = tuple[Scene, BlockFormat]


class FormatEncoding:
    """Encoding of `session.awaited_formats` in a separate process, because some encoders hold Python's interpreter lock."""

    def __init__(self, cache: Path, emit: EmitEvent) -> None:
        """Make the encoding; `cache` is the folder for encoded blocks."""
        self._cache, self._emit = cache, emit
        self._background = Background()
        self._asked: set[Key] = set()
        self._reports: dict[BlockFormat, JobReport] = {}

    @property
    def progress(self) -> Mapping[BlockFormat, JobReport]:
        """Progress of each awaited format."""
        return self._reports

    def take_news(self) -> bool:
        """Return True where a texture has been encoded since the last call."""
        return self._background.take_news()

    def step(self, session: Session) -> None:
        """Begin awaited formats, report finished ones, and cancel those that are no longer awaited."""
        wanted = {(session.scene, block_format) for block_format in session.awaited_formats.values()}
        for key in self._asked - wanted:
            self._background.cancel(key)
        self._asked, self._reports = wanted, {}
        for key in sorted(wanted, key=lambda key: key[1]):
            scene, block_format = key
            job = self._background.submit(key, partial(self._compressed, *key))
            if not job.done:
                self._reports[block_format] = job.report
                continue
            if error := job.future.exception():
                self._emit(TexturesCompressed(scene, block_format, None))
                self._emit(Notification(f"{block_format}: {job.problem}", "error", details_of(error)))
                continue
            compressed = job.result()
            self._emit(TexturesCompressed(scene, block_format, compressed))
            quality = f", mean {compressed.psnr.mean_db:.2f} dB" if compressed.psnr is not None else ""
            size = f"{compressed.bits_per_texel:.2f} bits per texel, {compressed.stored_bytes / 1e6:.2f} MB with mips"
            self._emit(Notification(f"{block_format}: {size}{quality}"))

    def _compressed(self, scene: Scene, block_format: BlockFormat, report: JobReport) -> CompressedTextures:
        """Encode all textures in a format (a job). Raises InputError where the encoder is not installed."""
        requests = compression_requests(scene, block_format, self._cache)
        pictures = [request for of_texture in requests for request in of_texture]
        textures = []
        for number, request in enumerate(pictures):
            # Cached blocks need no process.
            texture = cached_texture(request)
            textures.append(texture or HELPERS.call("block compression", compress_texture, request, report.check))
            report.progress(number + 1, len(pictures))
        return compressed_scene(block_format, requests, textures)

    def close(self) -> None:
        """End the encoding, even in the middle of a texture."""
        self._background.forget()
        self._background.close()


class PrecisionSearch:
    """Search for `session.precision_searches`. It takes seconds for a large pack; no frame waits for it."""

    def __init__(self, background: Background, fastest_first: Sequence[Precision], emit: EmitEvent) -> None:
        """Make the search among `fastest_first`, the driver's precisions from fastest to slowest."""
        self._background, self._fastest_first, self._emit = background, fastest_first, emit

    def step(self, session: Session) -> None:
        """Report the precisions that were chosen since the last call, with the reasons."""
        for side in sorted(session.precision_searches):
            slot = session.view.slots[side]
            pack = session.packs.get(slot.source)
            if slot.source == REFERENCE or pack is None:
                self._emit(PrecisionChosen(side, None))
                continue
            job = self._background.submit(("precision", pack), partial(self._precision, pack))
            if not job.done:
                continue
            if error := job.future.exception():
                self._emit(PrecisionChosen(side, None))
                self._emit(Notification(f"{slot.source}: {job.problem}", "error", details_of(error)))
                continue
            chosen = job.result()
            self._emit(PrecisionChosen(side, chosen.precision))
            self._emit(Notification(f"{slot.source}: precision {chosen.precision}: {chosen.reason}"))

    def _precision(self, pack: Pack, _report: JobReport) -> ChosenPrecision:
        return codec_of(pack.config).chosen_precision(pack, self._fastest_first)
