"""Targets of `encode` in codec `block`, and the lines that tell what was reached."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.encoding import PRESETS, BitsTarget, EncodingChoices, QualityTarget, SizeTarget, Target
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.metrics.metrics import bits_with_mips
from viewer.cli.options import EncodeOptions
from viewer.scene.json_text import counted

MOST_NAMES = 5
"""Textures that are named where a quality was not reached."""
NEAR_BITS = 0.02
"""Share of the bits asked for by which more are still as asked."""
LEAST_WORTH = 0.1
"""Least weight of a texture that is not seen, as a share of the mean."""


def given_targets(options: EncodeOptions) -> dict[str, str]:
    """Return the target options that are given, by name."""
    numbers = {"bits": options.bits, "quality": options.quality, "size": options.size}
    found = {name: f"{value:g}" for name, value in numbers.items() if value is not None}
    return found if options.preset is None else {**found, "preset": options.preset}


def asked_target(options: EncodeOptions) -> Target | None:
    """Return the target that the options name. Raises InputError for two at once, and for one that can never be reached."""
    given = list(given_targets(options))
    if len(given) > 1:
        raise InputError(f"{' and '.join(f'--{name}' for name in given)} exclude each other: give one of them")
    if options.quality is not None:
        return QualityTarget(options.quality)
    if options.size is not None:
        return SizeTarget(options.size)
    if options.preset is not None:
        return PRESETS[options.preset]
    return None if options.bits is None else BitsTarget(options.bits)


def encoding_choices(options: EncodeOptions) -> EncodingChoices:
    """Return the choices that the codec gets. Raises InputError as `asked_target` does."""
    return EncodingChoices(
        options.recipe,
        options.steps,
        options.epochs,
        options.device,
        options.state,
        asked_target(options),
        options.levels,
        options.seed,
    )


def worth_on_screen(views: Sequence[NDArray[np.int32]], texels: Sequence[int]) -> tuple[float, ...]:
    """Return the weight of errors in each texture by the pixels of `views` (texture ids, -1 for none) that show a texel of it, in
    proportion to their mean. `texels` by texture."""
    pixels = np.zeros(len(texels))
    for view in views:
        pixels += np.bincount(view[view >= 0].reshape(-1), minlength=len(texels))[: len(texels)]
    shown = pixels / np.array(texels, np.float64)
    worth = np.maximum(shown / max(float(shown.mean()), 1e-12), LEAST_WORTH)
    return tuple(worth.tolist())


def result_lines(target: Target, pack: Pack, out: Path) -> list[str]:
    """Return lines that compare the target with `pack`, written to `out`."""
    if isinstance(target, BitsTarget):
        more = bits_with_mips(pack) > target.bits * (1.0 + NEAR_BITS)
        why = "; not reached: so few or so small textures need more" if more else ""
        return [f"target: {target.bits:g} bits per texel of all mips{why}"]
    if isinstance(target, SizeTarget):
        return [f"file: {out.stat().st_size / 1e6:.3f} MB, asked for at most {target.megabytes:g}"]
    short = [each for each in pack.textures if each.psnr_db is not None and each.psnr_db < target.psnr_db]
    reached = len(pack.textures) - len(short)
    lines = [
        f"quality: {reached} of {counted(len(pack.textures), 'texture')} have at least {target.psnr_db:g} dB, as asked"
    ]
    if short:
        short.sort(key=lambda each: each.psnr_db or 0.0)
        names = ", ".join(f"{each.name} ({each.psnr_db:.2f} dB)" for each in short[:MOST_NAMES])
        others = f" and {len(short) - MOST_NAMES} more" if len(short) > MOST_NAMES else ""
        lines.append(f"not reached: {names}{others}")
    return lines
