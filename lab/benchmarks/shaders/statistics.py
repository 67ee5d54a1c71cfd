"""Registers, spills, instructions and occupancy of every decode program on an AMD GPU, compiled without one.

    python -m lab.benchmarks.shaders.statistics [--json FILE] [--codec NAME] [--family navi32]

Needs glslang and RADV (Mesa 23.2 or newer).
"""

import argparse
from collections.abc import Sequence
from math import gcd
from pathlib import Path
from typing import Any, Final

from lab.benchmarks.measuring import report
from lab.benchmarks.shaders.compiling import compiled, find_compiler
from lab.benchmarks.shaders.decoding_programs import CODECS, DecodingProgram, decoding_programs
from lab.benchmarks.shaders.machine_code import MachineCode
from ntc.codec.config import CodecConfig
from viewer.gl.context import create_headless_context
from viewer.render.resources.variant import GPU, DecoderVariant

FAMILY: Final = "navi32"
"""RX 7700 XT and 7800 XT."""
SEVERAL: Final = ("deferred, shared", "binned", "cached")
"""Paths whose invocations decode as many pixels as `DecoderVariant` says."""


def network_loops(found: DecodingProgram, variant: DecoderVariant) -> tuple[tuple[int, ...], int]:
    """How often the loops over both hidden layers run, none for codec `block`, and the pixels of one invocation."""
    config = found.config
    if not isinstance(config, CodecConfig):
        return (), 1
    blocks = config.hidden_width // 4
    if found.path not in SEVERAL:
        return (blocks, blocks), 1
    return (blocks // gcd(blocks, variant.unrolled), blocks), variant.pixels


def row(found: DecodingProgram, told: dict[str, Any], variant: DecoderVariant) -> dict[str, Any]:
    """What a program costs. Its vector instructions a texel are None for codec `block`, whose loops depend on the data."""
    loops, pixels = network_loops(found, variant)
    code = MachineCode.parsed(told["assembly"])
    return {
        "path": found.path,
        "codec": found.codec,
        "precision": found.precision,
        "VGPRs": told["VGPRs"],
        "spilled VGPRs": told["Spilled VGPRs"],
        "spilled SGPRs": told["Spilled SGPRs"],
        "scratch bytes": told["Scratch size"],
        "waves": told["Subgroups per SIMD"],
        "wave": told["subgroup"],
        "instructions": told["Instructions"],
        "code bytes": told["Code size"],
        "vector instructions a texel": round(code.vector_instructions(loops, pixels)) if loops else None,
    }


def statistics(codecs: Sequence[str], family: str = FAMILY, variant: DecoderVariant = GPU) -> list[dict[str, Any]]:
    """A row for each program. Raises InputError where a compiler is missing."""
    compiler = find_compiler(family)
    programs = decoding_programs(create_headless_context(), tuple(codecs))
    told = compiled(compiler, [found.program for found in programs])
    return [row(found, own, variant) for found, own in zip(programs, told, strict=True)]


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--codec", action="append", choices=tuple(CODECS), help="may be given again; default all")
    parser.add_argument("--family", default=FAMILY)
    options = parser.parse_args()
    rows = statistics(options.codec or tuple(CODECS), options.family)
    report("decode programs", rows, {"family": options.family}, options.json)


if __name__ == "__main__":
    main()
