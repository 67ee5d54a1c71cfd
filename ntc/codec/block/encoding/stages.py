"""Encoding in codec `block`, in closed form on the CPU: tables are fitted to a group, then its textures are encoded.

Where a quality is asked for, textures are corrected until they have it.
"""

from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, cast

import numpy as np

from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.block.encoding.bit_allocation import TextureWeights
from ntc.codec.block.encoding.blocks import PreparedTexture, reduced
from ntc.codec.block.encoding.groups import (
    FittedGroup,
    allocated_words,
    encode_member,
    encoding_record,
    fitted_group,
)
from ntc.codec.block.encoding.measuring import finest_image, shown_channels
from ntc.codec.block.encoding.progress import WorkCount
from ntc.codec.block.encoding.rate import FEW_TEXTURES, fitting_work, has_preview, texture_work
from ntc.codec.block.encoding.to_quality import CORRECTIONS, Member, Try, config_for_quality, with_mean_words
from ntc.codec.block.model import BlockDecoder, BlockTexture, block_parts
from ntc.codec.encoding import EncodedGroup, Encoder, EncodingProgress, EncodingTask, Piece
from ntc.codec.model import Decoder, EncodedTexture
from ntc.codec.quality import measured_texture, mse_of_psnr
from ntc.codec.textures import SourceTexture
from ntc.errors import TrainingCancelledError
from ntc.threads import PacedThreads, mapped, most_threads

MOST_PREPARED = 1 << 28
"""Most values of all textures of a task for which textures stay in blocks between fitting and encoding."""
HIGHEST_PSNR_DB = 120.0
"""PSNR reported of exact textures, because curves cannot show infinity."""


class BlockEncoder(Encoder):
    """Encodes the groups of a task. A texture is a piece of work."""

    def __init__(self, task: EncodingTask, fitted: Sequence[FittedGroup] | None = None) -> None:
        """`fitted`: the tables of all groups of the task, where they are known already."""
        self._task, self._options = task, cast(BlockOptions, task.options)
        self.settings = self._config = cast(BlockConfig, task.settings)
        self._given = fitted
        self._weights = TextureWeights(self._options.balance, self._options.weights)
        self._fitted: dict[int, FittedGroup] = {}
        self._found: dict[int, BlockTexture] = {}
        self._work, self._step, self._steps = "", 0, 0
        self._count = WorkCount()
        """Work in blocks, each counted once for each pass over it."""
        self._threads_each = 1
        """Threads that encode one texture."""
        self._prepared: dict[SourceTexture, PreparedTexture] = {}
        """Textures in blocks that wait to be encoded."""
        self._ended: set[int] = set()
        self._previews: dict[int, EncodedGroup] = {}
        """Coarse groups to show until they are encoded."""

    def pieces(self) -> Generator[Piece]:
        """Do the work (`Encoder.pieces`). Raises InputError for a quality that no settings reach."""
        if self._options.texture_words:
            yield from self._encode_again(dict(self._options.texture_words))
            return
        if self._options.quality_db is not None:
            yield from self._correct(self._options.quality_db)
            return
        members = [index for group in self._task.groups for index in self._task.grouping.members(group)]
        self._count.expect(self._textures_work(members))
        if self._given is None:
            self._count.expect(sum(map(self._fitting_work, self._task.groups)))
        if self._options.preview_side is not None:
            yield from self._preview(self._options.preview_side)
        with self._threads_for(len(members)) as paced:
            for fitted, words in self._plans():
                self._fitted[fitted.group] = fitted
                self._work, self._step, self._steps = "encoding texture", len(self._found), len(members)
                encode = partial(self._encoded, fitted)
                parts = list(zip(fitted.members, words, strict=True))
                sizes = self._pixels(fitted.members)
                for index, encoded in zip(fitted.members, paced.map(encode, parts, sizes), strict=True):
                    yield self._done(index, encoded)

    @property
    def replaces(self) -> bool:
        """True where single textures are encoded again with other words."""
        return bool(self._options.texture_words)

    def _encode_again(self, words: Mapping[int, float]) -> Iterator[Piece]:
        """Encode the textures of `words` again, with so many words per block, under the decoders that the task starts from."""
        assert self._task.start is not None
        start = block_parts(self._task.start)
        self._count.expect(self._textures_work(tuple(words)))
        self._threads_for(1)
        self._work, self._steps = "encoding texture", len(words)
        for group in self._task.groups:
            members = self._task.grouping.members(group)
            self._fitted[group] = FittedGroup(group, members, start.decoders[group], ())
            for index in members:
                encoded = start.textures[index]
                if index in words:
                    encoded = self._encoded(self._fitted[group], (index, words[index]))
                    self._step += 1
                self._found[index] = encoded
            yield Piece(ended=(group,))

    def _preview(self, side: int) -> Iterator[Piece]:
        """Encode reduced textures of the groups that have PREVIEW_TIMES as many texels, with tables fitted to them."""
        task = self._task
        small = tuple(reduced(texture, side) for texture in task.textures)

        def is_previewed(group: int) -> bool:
            members = task.grouping.members(group)
            return has_preview([task.textures[i].size for i in members], [small[i].size for i in members])

        groups = tuple(filter(is_previewed, task.groups))
        if not groups:
            return
        options = replace(self._options, preview_side=None)
        encoder = BlockEncoder(replace(task, textures=small, groups=groups, options=options))
        # Its work, which it expects itself, is counted with all other.
        encoder._count = self._count
        self._work, self._step, self._steps = "coarse picture of group", 0, len(groups)
        for piece in encoder.pieces():
            for coarse in encoder.encoded(piece.ended):
                # Its quality is that of other textures.
                unknown: dict[str, Any] = {"psnr_db": None, "map_psnr_db": (), "normal_degrees": None}
                self._previews[coarse.group] = replace(
                    coarse, textures=tuple(replace(texture, **unknown) for texture in coarse.textures)
                )
                self._step += 1
                yield Piece(groups=(coarse.group,), is_first=True)

    @property
    def _most_threads(self) -> int:
        return self._options.threads or most_threads()

    def _threads_for(self, textures: int) -> PacedThreads:
        """Threads that encode so many textures: a texture each, or all one texture where textures are few."""
        most = self._most_threads
        self._threads_each = most if textures <= FEW_TEXTURES else 1
        return PacedThreads(1 if self._threads_each > 1 else most)

    def _plans(self) -> Iterator[tuple[FittedGroup, tuple[float, ...]]]:
        """Groups with the words of their members, in the order in which they are encoded."""
        task, options = self._task, self._options
        if not options.groups_apart:
            fitted = self._given or self._fit(self._config, task.groups)
            yield from zip(fitted, allocated_words(fitted, self._config, self._weights), strict=True)
            return
        # The smallest groups first, so that the first picture appears at once.
        for number, group in enumerate(sorted(task.groups, key=self._texels_of)):
            (fitted_alone,) = self._fit(self._config, [group], number)
            yield fitted_alone, allocated_words([fitted_alone], self._config, self._weights)[0]

    def _fit(self, config: BlockConfig, groups: Sequence[int], fitted: int = 0) -> list[FittedGroup]:
        task, most = self._task, self._most_threads
        self._work, self._step, self._steps = "fitting group", fitted, len(task.groups)

        def fit(group: int) -> FittedGroup:
            task.interruption()
            whole = self._fitting_work(group)

            def worked(share: float) -> None:
                self._worked(share * whole)

            # Groups side by side, or the textures of one.
            threads = most if len(groups) == 1 else 1
            few = sum(texture.pixels.size for texture in task.textures) <= MOST_PREPARED
            prepared = self._prepared if few and self._options.quality_db is None else None
            fitted_tables = fitted_group(
                task.textures, task.grouping, group, config, self._options.seed, worked, threads, prepared
            )
            self._step += 1
            return fitted_tables

        return mapped(fit, groups, most)

    def _texels_of(self, group: int) -> int:
        sizes = [self._task.textures[index].size for index in self._task.grouping.members(group)]
        return sum(width * height for width, height in sizes)

    def _encoded(self, fitted: FittedGroup, part: tuple[int, float]) -> BlockTexture:
        index, words = part
        source = self._task.textures[index]
        return encode_member(
            source,
            words,
            fitted,
            self._config,
            self._worked,
            self._threads_each,
            self._prepared.pop(source, None),
            self._options.may_split_mips,
            self._count.expect,
        )

    def _worked(self, work: float) -> None:
        """Count work; called in the thread of a texture."""
        self._count.add(work)
        self._task.interruption()

    def _textures_work(self, members: Sequence[int]) -> float:
        """Work of encoding textures once."""
        return sum(texture_work(self._task.textures[index].size, self._config) for index in members)

    def _fitting_work(self, group: int) -> float:
        """Work of fitting a group once."""
        task = self._task
        return fitting_work([task.textures[index].size for index in task.grouping.members(group)], self._config)

    def _done(self, index: int, encoded: BlockTexture) -> Piece:
        """Return the piece of work that a finished texture ends."""
        self._found[index] = encoded
        self._step += 1
        group = self._task.grouping.groups[index]
        whole = group not in self._ended and self._found.keys() >= set(self._task.grouping.members(group))
        if whole and self._options.quality_db is None:
            self._ended.add(group)
            return Piece(ended=(group,))
        return Piece()

    def _correct(self, target_db: float) -> Iterator[Piece]:
        """Encode each texture in the words that it is expected to need; then correct those that miss the target. An interrupted
        correction leaves the textures as they are."""
        task = self._task
        every = range(len(task.textures))
        # Tables are fitted twice, and each texture may be corrected.
        fitting, planned = sum(map(self._fitting_work, task.groups)), 2.0 * self._textures_work(every)
        self._count.expect(2.0 * fitting + planned)
        self._work, self._step, self._steps = "fitting group", 0, len(task.groups)
        self._config = self.settings = config_for_quality(task, target_db, self._options.seed)
        self._count.add(fitting)
        to_correct = self._textures_work(every)
        # Other settings have other blocks.
        self._count.expect(sum(map(self._fitting_work, task.groups)) - fitting + 2.0 * to_correct - planned)
        fitted = self._fit(self._config, task.groups)
        self._fitted = {each.group: each for each in fitted}
        paced_threads = self._threads_for(len(task.textures))
        threads = self._threads_each
        members = {
            index: Member(task.textures[index], each, curve, self._config, target_db, self._worked, threads)
            for each in fitted
            for index, curve in zip(each.members, each.curves, strict=True)
        }
        tries: dict[int, Try] = {}

        def once_more(index: int) -> Try:
            return members[index].correct(tries[index]) if index in tries else members[index].encode(target_db)

        with paced_threads as paced:
            for work in ("encoding texture", "correcting texture"):
                due = [index for index in members if index not in tries or not members[index].suits(tries[index])]
                if tries:
                    self._count.expect(CORRECTIONS * self._textures_work(due) - to_correct)
                self._work, self._step, self._steps = work, 0, len(due)
                try:
                    for index, encoded in zip(due, paced.map(once_more, due, self._pixels(due)), strict=True):
                        tries[index] = encoded
                        yield self._done(index, encoded.texture)
                except TrainingCancelledError:
                    if len(tries) < len(members):
                        raise
        self._count.expect(self._count.done - self._count.planned)
        self.settings = with_mean_words(self._config, fitted, [each.texture for each in tries.values()])
        yield Piece(ended=tuple(task.groups))

    def _pixels(self, members: Sequence[int]) -> list[int]:
        return [self._task.textures[index].pixels.size for index in members]

    def figures(self) -> EncodingProgress:
        by_group: dict[int, list[float]] = {}
        # A copy: the texture that is finished next is added in another thread.
        psnrs = {index: texture.psnr_db or 0.0 for index, texture in dict(self._found).items()}
        for index, decibels in psnrs.items():
            by_group.setdefault(self._task.grouping.groups[index], []).append(mse_of_psnr(decibels) / 255.0**2)
        sizes = [self._task.textures[index].size for index in psnrs]
        return EncodingProgress(
            share=self._count.share,
            passes=self._count.planned * self._config.block_side**2,
            step=min(self._step + 1, self._steps),
            steps=self._steps,
            texels=sum(width * height for width, height in sizes),
            losses={group: float(np.mean(values)) for group, values in sorted(by_group.items())},
            psnr_db={index: min(decibels, HIGHEST_PSNR_DB) for index, decibels in psnrs.items()},
            work=self._work,
        )

    def encoded(self, groups: Sequence[int]) -> Iterator[EncodedGroup]:
        for group in groups:
            if group in self._previews and group not in self._ended:
                yield self._previews[group]
                continue
            fitted = self._fitted[group]
            yield EncodedGroup(
                group, fitted.members, tuple(map(self._found.__getitem__, fitted.members)), fitted.decoder
            )

    def measured(
        self, textures: Sequence[EncodedTexture], decoder: Decoder, members: Sequence[int]
    ) -> tuple[EncodedTexture, ...]:
        measured = []
        for texture, index in zip(textures, members, strict=True):
            self._task.interruption()
            decoded = finest_image(cast(BlockTexture, texture), cast(BlockDecoder, decoder), self._config)
            shown = shown_channels(decoded, texture.places(self._config))
            measured.append(measured_texture(texture, shown, self._task.textures[index].pixels))
        return tuple(measured)

    def record(self) -> dict[str, Any]:
        return encoding_record(self._options.seed)
