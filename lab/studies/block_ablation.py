"""What each setting of codec `block` is worth: it is changed, and textures share as many bits as before."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from lab.runner import Report
from lab.studies.runs import RunResult
from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.block.encoding.rate import block_count, config_for_bits, side_bits, texel_count
from ntc.codec.block.encoding.sharing import DEFAULT_SHARING, Sharing
from ntc.codec.encoding import TextureSet, texture_set
from ntc.codec.model import Grouping
from ntc.codec.quality import finite_or_none
from ntc.codec.textures import SourceTexture
from ntc.metrics.metrics import bits_with_mips
from ntc.training.encode import encode_textures


@dataclass(frozen=True)
class Variant:
    """Settings that are compared."""

    config: BlockConfig
    sharing: Sharing = DEFAULT_SHARING


def _at_bits(config: BlockConfig, known: TextureSet, bits: float) -> BlockConfig:
    """`config` with the words that come to `bits` a texel, as far as its sizes of codes allow that."""
    left = bits * texel_count(known.sizes, config) - side_bits(known, config)
    words = left / (32.0 * block_count(known.sizes, config))
    return replace(config, mean_words=min(max(words, config.block_words[0]), config.block_words[-1]))


def block_variants(
    textures: Sequence[SourceTexture], grouping: Grouping, bits: float, levels: int | None, base: str
) -> Mapping[str, Variant]:
    """By name; the settings that everything is compared with are called `base`."""
    known = texture_set(textures, grouping.stored_decoders, levels)
    best = config_for_bits(bits, known)
    words = round(best.mean_words)
    changed = {
        base: best,
        "blocks of 4x4 texels": config_for_bits(bits, known, 4),
        f"codes of {words} words alone": replace(best, block_words=(words,)),
        "two sizes of codes": replace(best, block_words=(best.block_words[0], best.block_words[-1])),
        "half the coefficients": replace(best, coefficients=best.coefficients // 2),
        "1.5 times the coefficients": replace(best, coefficients=min(best.coefficients * 3 // 2, best.block_values)),
        "8 modes": replace(best, modes=8),
        "64 modes": replace(best, modes=64),
    }
    found = {name: Variant(_at_bits(config, known, bits)) for name, config in changed.items()}
    for balance, means in ((0.0, "least mean square error"), (0.5, "between"), (1.0, "greatest mean PSNR")):
        found[f"balance {balance:g}: {means}"] = Variant(best, Sharing(balance))
    for other in (0.5 * bits, 2.0 * bits):
        found[f"mean words for {other:g} bits"] = Variant(config_for_bits(other, known))
    return found


def measured_variant(
    name: str, variant: Variant, textures: Sequence[SourceTexture], grouping: Grouping, seed: int, report: Report
) -> RunResult:
    """Encode in the settings of `variant`. Bits count all mips, over the texels of mip 0."""
    began = time.process_time()
    options = BlockOptions(seed, worth=variant.sharing.worth, balance=variant.sharing.balance)
    pack = encode_textures(
        textures, grouping, variant.config, options, lambda progress: report(progress.step, progress.steps)
    )
    return RunResult(
        name=name,
        grouping=grouping.name,
        groups=grouping.group_count,
        seed=seed,
        psnr_db=tuple(finite_or_none(texture.psnr_db) for texture in pack.textures),
        bits_per_texel=bits_with_mips(pack),
        seconds=time.process_time() - began,
        texels=0,
        multiply_adds=variant.config.multiply_adds,
    )
