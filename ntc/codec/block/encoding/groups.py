"""Groups of textures in codec `block`: their tables, the bit allocation among their textures, and a texture encoded under them."""

import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import Any

import numpy as np

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.bit_allocation import RateCurve, TextureWeights, allocate_words
from ntc.codec.block.encoding.blocks import PreparedTexture, Sample, prepare_texture, sample_textures
from ntc.codec.block.encoding.encoder import encode_texture, texture_choices
from ntc.codec.block.encoding.gains import fitted_gains
from ntc.codec.block.encoding.measuring import finest_image, shown_channels
from ntc.codec.block.encoding.mips_per_code import MipQuality, is_doubtful, loses_much
from ntc.codec.block.encoding.rate import block_count
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
    """A group with its tables and the rate curves of its textures."""

    group: int
    members: tuple[int, ...]
    """Indices of its textures."""
    decoder: BlockDecoder
    curves: tuple[RateCurve, ...]
    """Rate curves of the members."""


def fitted_group(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    group: int,
    config: BlockConfig,
    seed: int,
    worked: Callable[[float], None] = lambda _share: None,
    threads: int = 1,
    prepared: dict[SourceTexture, PreparedTexture] | None = None,
) -> FittedGroup:
    """Return a group with its tables, which are fitted to samples of its textures or shipped. `seed` decides which blocks are
    sampled. `worked` gets the share of the work done since its last call; `threads` change nothing. `prepared` receives the textures
    in blocks."""
    members = grouping.members(group)
    samples = sample_textures([textures[index] for index in members], config, seed, threads=threads, prepared=prepared)
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
    """Return `groups` of `grouping` with their tables. Raises what `interruption` raises."""
    fitted = []
    for group in groups:
        interruption()
        fitted.append(fitted_group(textures, grouping, group, config, seed))
    return fitted


def allocated_words(
    fitted: Sequence[FittedGroup], config: BlockConfig, weights: TextureWeights
) -> list[tuple[float, ...]]:
    """Return the words per block by group and member, where all textures of these groups share the words of all their blocks."""
    curves = [curve for each in fitted for curve in each.curves]
    if weights.given is not None:
        weights = replace(weights, given=tuple(weights.given[index] for each in fitted for index in each.members))
    words = iter(allocate_words(curves, config.mean_words * sum(curve.block_count for curve in curves), weights))
    return [tuple(next(words) for _ in each.members) for each in fitted]


def encoding_record(seed: int) -> dict[str, Any]:
    """Return the record of an encoding in its pack: seed and versions of the installed libraries."""
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
    may_split_mips: bool = True,
    expect: Callable[[float], None] = lambda _: None,
) -> BlockTexture:
    """Return a texture of a group as a pack stores it, with its PSNR, in at most `words` words per block on average. `worked` gets
    the blocks that passes finished since its last call. `threads` change no byte.

    With `may_split_mips`, a texture whose derived mips are worse than mip 0 gets fewer mips per code, in as many bytes, if that is
    better. `expect` gets the additional work.
    """
    decoder, group = fitted.decoder, fitted.group
    prepared = prepared or prepare_texture(source, config)
    choices = texture_choices(prepared, decoder, config, worked, threads)
    encoded = encode_texture(source, decoder, config, words, group, worked, threads, prepared, choices=choices)
    measured = _measured(encoded, source, fitted, config, threads)
    code_mips = None
    if may_split_mips and is_doubtful(measured.psnr_db or 0.0, prepared.derived_errors):
        quality = MipQuality.of(encoded, prepared, decoder, config)
        code_mips = quality.fewer_mips(config)
    if code_mips is None:
        worked(block_count([source.size], config))
        return measured

    again = prepare_texture(source, config, code_mips)
    # Blocks of mip 0 come first, and suit the same modes as long as mip 1 is derived from them.
    same = choices.of_first(texture_levels(encoded, config)[0].cells) if again.axes.has_derived else None
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
    texture: BlockTexture, source: SourceTexture, fitted: FittedGroup, config: BlockConfig, threads: int
) -> BlockTexture:
    """Return `texture` with the quality of its mip 0."""
    decoded = shown_channels(finest_image(texture, fitted.decoder, config, threads), texture.places(config))
    return measured_texture(texture, decoded, source.pixels)
