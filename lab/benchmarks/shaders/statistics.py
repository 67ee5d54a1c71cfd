"""Registers, spills, instructions and occupancy of every decode program on GPUs of AMD and Intel, compiled without them.

    python -m lab.benchmarks.shaders.statistics [--json FILE] [--gpu navi32|dg2] [--codec NAME]

Needs glslang and the Vulkan drivers of Mesa 23.2 or newer; for Intel a C compiler, too.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from math import gcd
from pathlib import Path
from typing import Any, Final

from lab.benchmarks.shaders.compiling import GPUS, compiled, find_compiler
from lab.benchmarks.shaders.decoding_programs import CODECS, DecodingProgram, decoding_programs
from lab.benchmarks.shaders.machine_code import MachineCode
from lab.runner import report
from ntc.codec.gpu import GPU, DecoderVariant
from ntc.codec.grid.model import GridConfig
from ntc.errors import InputError
from viewer.gl.context import create_headless_context

SEVERAL: Final = ("deferred, shared", "binned", "cached")
"""Paths whose invocations decode as many pixels as `DecoderVariant` says."""


def network_loops(found: DecodingProgram, variant: DecoderVariant) -> tuple[tuple[int, ...], int]:
    """How often the loops over both hidden layers run, none for codec `block`, and the pixels of one invocation."""
    config = found.config
    if not isinstance(config, GridConfig):
        return (), 1
    blocks = config.hidden_width // 4
    if found.path not in SEVERAL:
        return (blocks, blocks), 1
    return (blocks // gcd(blocks, variant.unrolled), blocks), variant.pixels


FIGURES: Final = ("registers", "scratch bytes", "waves", "lanes", "instructions")
AMD: Final = ("VGPRs", "Scratch size", "Subgroups per SIMD", "subgroup", "Instructions")
"""FIGURES as RADV names them."""
INTEL: Final = ("Max live registers", "Scratch Memory Size", "", "subgroup", "Instruction Count")
"""FIGURES as ANV names them: a thread has all its registers, whatever it needs, so there are no waves to tell."""

SPILLS: Final = ("Spilled VGPRs", "Spilled SGPRs", "Spill Count")
"""What both drivers tell of registers that are kept in memory."""


def row(found: DecodingProgram, told: Mapping[str, Any], variant: DecoderVariant) -> dict[str, Any]:
    """What a program costs; None where the compiler failed. Vector instructions a texel are None for codec `block`, whose loops
    depend on the data."""
    loops, pixels = network_loops(found, variant)
    names = AMD if "VGPRs" in told else INTEL
    figures = {figure: told.get(name) for figure, name in zip(FIGURES, names, strict=True)}
    # ANV's code for arithmetic in halves has more loops than those of the layers, which are not told apart.
    counted = bool(loops) and "assembly" in told and ("VGPRs" in told or found.precision in ("fp32", "fp16"))
    code = MachineCode.parsed(told.get("assembly", ""))
    return {
        "path": found.path,
        "codec": found.codec,
        "precision": found.precision,
        "spills": sum(int(told[name]) for name in SPILLS if name in told) if told else None,
        **figures,
        "vector instructions a texel": round(code.vector_instructions(loops, pixels)) if counted else None,
    }


def statistics(gpu: str, programs: Sequence[DecodingProgram], variant: DecoderVariant = GPU) -> list[dict[str, Any]]:
    """A row for each program on a GPU of GPUS. Raises InputError where a compiler is missing."""
    told = compiled(find_compiler(gpu), [found.program for found in programs])
    return [{"gpu": gpu, **row(found, own, variant)} for found, own in zip(programs, told, strict=True)]


def main() -> int:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--codec", action="append", choices=tuple(CODECS), help="may be given again; default all")
    parser.add_argument("--gpu", action="append", choices=tuple(GPUS), help="may be given again; default all")
    options = parser.parse_args()
    programs = decoding_programs(create_headless_context(), tuple(options.codec or CODECS))
    try:
        rows = [own for gpu in options.gpu or GPUS for own in statistics(gpu, programs)]
    except InputError as error:
        print(error, file=sys.stderr)
        return 1
    report("decode programs", rows, {}, options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
