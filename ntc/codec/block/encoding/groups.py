"""Groups of textures in codec `block`: their tables, how their textures share words, and a texture encoded under them."""

import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import Any

import numpy as np

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.blocks import PreparedTexture, Sample, prepare_texture, sample_textures
from ntc.codec.block.encoding.encoder import encode_texture, texture_choices
from ntc.codec.block.encoding.gains import fitted_gains
from ntc.codec.block.encoding.measuring import finest_image, shown_channels
from ntc.codec.block.encoding.own_codes import MipQuality, is_doubtful, loses_much
from ntc.codec.block.encoding.rate import block_count
from ntc.codec.block.encoding.sharing import RateCurve, Sharing, share_words
from ntc.codec.block.encoding.tables import fit_decoder, rate_curve
from ntc.codec.block.model import BlockDecoder, BlockTexture
from ntc.codec.block.universal import universal_decoder
from ntc.codec.config import UNIVERSAL
from ntc.codec.encoding import Interruption, no_interruption
from ntc.codec.latents import texture_levels
from ntc.codec.model import Grouping
from ntc.codec.quality import measured_texture
from ntc.codec.textures import SourceTexture
from ntc.threads import mapped


@dataclass(frozen=True, eq=False)
class FittedGroup:
    """A group whose tables are known, and what words are worth to its textures."""

    group: int
    members: tuple[int, ...]
    """Indices of its textures."""
    decoder: BlockDecoder
    curves: tuple[RateCurve, ...]
    """Of the members."""


def fitted_group(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    group: int,
    config: BlockConfig,
    seed: int,
    worked: Callable[[float], None] = lambda _share: None,
    threads: int = 1,
    kept: dict[SourceTexture, PreparedTexture] | None = None,
) -> FittedGroup:
    """The tables of a group: fitted to samples of its textures, or those that ship. `seed` decides which blocks are sampled. `worked`
    is told the share of the work that was done since; `threads` change nothing. `kept` gets the textures in blocks."""
    members = grouping.members(group)
    samples = sample_textures([textures[index] for index in members], config, seed, threads=threads, kept=kept)
    decoder = _decoder(samples, grouping, config, seed, worked)
    curves = mapped(lambda sample: rate_curve(sample, decoder, config), samples, threads)
    return FittedGroup(group, members, decoder, tuple(curves))


def _decoder(
    samples: Sequence[Sample],
    grouping: Grouping,
    config: BlockConfig,
    seed: int,
    worked: Callable[[float], None],
) -> BlockDecoder:
    if config.tables is None and grouping.name != UNIVERSAL:
        return fit_decoder(samples, config, seed, worked)
    decoder = universal_decoder(config.output_channels) if config.tables is None else fitted_gains(samples, config)
    worked(1.0)
    return decoder


def fitted_groups(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    groups: Sequence[int],
    config: BlockConfig,
    seed: int,
    interruption: Interruption = no_interruption,
) -> list[FittedGroup]:
    """These groups of `grouping`. Raises what `interruption` raises."""
    fitted = []
    for group in groups:
        interruption()
        fitted.append(fitted_group(textures, grouping, group, config, seed))
    return fitted


def shared_words(fitted: Sequence[FittedGroup], config: BlockConfig, sharing: Sharing) -> list[tuple[float, ...]]:
    """By group and member: words a block, where the textures of these groups share the words of all their blocks."""
    curves = [curve for each in fitted for curve in each.curves]
    if sharing.worth is not None:
        sharing = replace(sharing, worth=tuple(sharing.worth[index] for each in fitted for index in each.members))
    words = iter(share_words(curves, config.mean_words * sum(curve.block_count for curve in curves), sharing))
    return [tuple(next(words) for _ in each.members) for each in fitted]


def encoding_record(seed: int) -> dict[str, Any]:
    """What a pack records of its encoding."""
    return {
        "codec": BlockConfig.kind,
        "seed": seed,
        "device": "cpu",
        "torch": version("torch"),
        "numpy": np.__version__,
        "python": platform.python_version(),
    }


def encode_member(
    source: SourceTexture,
    words: float,
    fitted: FittedGroup,
    config: BlockConfig,
    worked: Callable[[float], None],
    threads: int = 1,
    prepared: PreparedTexture | None = None,
    has_own_codes: bool = True,
    expect: Callable[[float], None] = lambda _: None,
) -> BlockTexture:
    """A texture of a group as a pack stores it, with its PSNR, in `words` words a block on average at most. `worked` is told the
    blocks that a pass was over since it was called last. `threads` work on it and change no byte.

    Where `has_own_codes`, a texture whose derived mips are below mip 0 has fewer mips per code, in as many bytes, if that is better.
    `expect` is told how much more work that is.
    """
    decoder, group = fitted.decoder, fitted.group
    prepared = prepared or prepare_texture(source, config)
    choices = texture_choices(prepared, decoder, config, worked, threads)
    found = encode_texture(source, decoder, config, words, group, worked, threads, prepared, choices=choices)
    measured = _measured(found, source, fitted, config, threads)
    code_mips = None
    if has_own_codes and is_doubtful(measured.psnr_db or 0.0, prepared.derived_errors):
        quality = MipQuality.of(found, prepared, decoder, config)
        code_mips = quality.fewer_mips(config)
    if code_mips is None:
        worked(block_count([source.size], config))
        return measured

    again = prepare_texture(source, config, code_mips)
    # Blocks of mip 0 come first, and suit the same modes as long as mip 1 is derived from them.
    same = choices.of_first(texture_levels(found, config)[0].cells) if again.axes.has_derived else None
    expect(2 * len(again.texels) - (len(same.errors) if same is not None else 0))
    chosen = texture_choices(again, decoder, config, worked, threads, same)
    other = encode_texture(source, decoder, config, words, group, worked, threads, again, code_mips, chosen)
    # The measure of both.
    worked(block_count([source.size], config))
    if not MipQuality.of(other, again, decoder, config).is_better(quality):
        return measured
    other = _measured(other, source, fitted, config, threads)
    return measured if loses_much(other.psnr_db or 0.0, measured.psnr_db or 0.0) else other


def _measured(
    found: BlockTexture, source: SourceTexture, fitted: FittedGroup, config: BlockConfig, threads: int
) -> BlockTexture:
    """`found` with the quality of its mip 0."""
    decoded = shown_channels(finest_image(found, fitted.decoder, config, threads), found.places(config))
    return measured_texture(found, decoded, source.pixels)
