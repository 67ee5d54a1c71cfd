"""Instruction counts of machine code in the disassembly of Mesa's drivers for AMD and Intel, along the path of one invocation."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

_INSTRUCTION: Final = re.compile(r"^(?:\s+(\w+)|\(invalid instruction\)).*;((?: [0-9a-f]{8})+)\s*$")
_REPEATED: Final = re.compile(r"^\s*\(then repeated (\d+) times\)")
_LONG_VECTOR: Final = ("d5", "d6", "cc")
"""How the first of two words of vector arithmetic begins, by which instructions are known that the disassembler does not know."""
_BRANCH: Final = re.compile(r"s_c?branch\w*$")
_MULTIPLY_ADD: Final = re.compile(r"v_(dual_)?(pk_)?(fma|mad|dot)")
_LABEL: Final = re.compile(r"^LABEL(\d+):")
_INTEL_INSTRUCTION: Final = re.compile(r"^(?:\([^)]*\) )?(\w+)(?:\.\S+)?\((\d+)\)")
_JUMP_BACK: Final = re.compile(r"\bwhile\(.*JIP:\s*LABEL(\d+)")
LEAST_LANES: Final = 8
"""Of a subgroup on Intel."""
JUMPS: Final = frozenset({"if", "else", "endif", "while", "break", "cont", "halt", "jmpi", "sync", "nop"})
WORD: Final = 4
"""Bytes. A branch names its target in words after it, as a signed number of 16 bits."""


@dataclass(frozen=True)
class Loop:
    """Instructions `first` to `last`, both by number, of which the last goes back to the first."""

    first: int
    last: int

    def __contains__(self, number: int) -> bool:
        return self.first <= number <= self.last


@dataclass(frozen=True)
class MachineCode:
    """The instructions of one shader."""

    names: tuple[str, ...]
    loops: tuple[Loop, ...]
    """In the order in which they begin."""

    @classmethod
    def parsed(cls, assembly: str) -> "MachineCode":
        """Return the code in the disassembly of either driver."""
        return cls._of_intel(assembly) if "align1" in assembly else cls._of_amd(assembly)

    @classmethod
    def _of_intel(cls, assembly: str) -> "MachineCode":
        """Instructions get AMD's prefixes: `v_` for those of whole subgroups, `s_` for those of fewer lanes and for jumps."""
        names: list[str] = []
        labels: dict[str, int] = {}
        loops: list[Loop] = []
        for line in assembly.splitlines():
            label, match, back = _LABEL.match(line), _INTEL_INSTRUCTION.match(line), _JUMP_BACK.search(line)
            if label:
                labels[label[1]] = len(names)
            if back and back[1] in labels:
                loops.append(Loop(labels[back[1]], len(names)))
            if match:
                is_scalar = int(match[2]) < LEAST_LANES or match[1] in JUMPS
                names.append(f"{'s' if is_scalar else 'v'}_{match[1]}")
        return cls(tuple(names), tuple(sorted(loops, key=lambda loop: loop.first)))

    @classmethod
    def _of_amd(cls, assembly: str) -> "MachineCode":
        """Each instruction has its code behind it."""
        names: list[str] = []
        places: dict[int, int] = {}
        branches: list[tuple[int, int]] = []
        place, words = 0, list[str]()
        for line in assembly.splitlines():
            repeated, match = _REPEATED.match(line), _INSTRUCTION.match(line)
            if repeated:
                names += names[-1:] * int(repeated[1])
                place += WORD * len(words) * int(repeated[1])
            if match is None:
                continue
            words = match[2].split()
            # Each word of an unknown instruction has a separate line.
            name = match[1] or ("v_unknown" if words[0].startswith(_LONG_VECTOR) else "s_unknown")
            places[place] = len(names)
            if _BRANCH.match(name):
                jump = int(words[0], 16) & 0xFFFF
                branches.append((len(names), place + WORD * (1 + jump - ((jump & 0x8000) << 1))))
            names.append(name)
            place += WORD * len(words)
        ends: dict[int, int] = {}
        for number, target in branches:
            if target in places and places[target] <= number:
                ends[places[target]] = max(number, ends.get(places[target], 0))
        return cls(tuple(names), tuple(Loop(first, last) for first, last in sorted(ends.items())))

    def _innermost(self, number: int) -> Loop | None:
        around = [loop for loop in self.loops if number in loop]
        return min(around, key=lambda loop: loop.last - loop.first, default=None)

    def vector_instructions(self, lengths: Sequence[int] = (), pixels: int = 1) -> float:
        """Vector instructions, of arithmetic and of memory, for one of the `pixels` that an invocation decodes.

        The loops with the most multiply-adds are those over the network's layers: they run as often as `lengths` says, once for all
        pixels, as does what is outside of loops. Other loops run once for each pixel. Of branches all sides count.
        Raises ValueError where the code has no loops of the network.
        """
        innermost = [self._innermost(number) for number in range(len(self.names))]
        products = {
            loop: sum(
                place == loop and bool(_MULTIPLY_ADD.match(name))
                for place, name in zip(innermost, self.names, strict=True)
            )
            for loop in self.loops
        }
        largest = sorted(
            sorted(products, key=lambda loop: -products[loop])[: len(lengths)], key=lambda loop: loop.first
        )
        if len(largest) < len(lengths):
            raise ValueError(f"the code has {len(largest)} loops, and the network {len(lengths)}")
        times: dict[Loop | None, float] = dict.fromkeys(self.loops, 1.0)
        times |= {None: 1.0 / pixels}
        times |= {loop: length / pixels for loop, length in zip(largest, lengths, strict=True)}
        return sum(times[place] for place, name in zip(innermost, self.names, strict=True) if is_vector(name))

    def weighted(self, times: Sequence[float]) -> float:
        """Vector instructions where each of `loops` runs as often as `times` says. Raises ValueError for another number of loops."""
        if len(times) != len(self.loops):
            raise ValueError(f"the code has {len(self.loops)} loops, and {len(times)} are known")
        weights: dict[Loop | None, float] = {None: 1.0, **dict(zip(self.loops, times, strict=True))}
        innermost = (self._innermost(number) for number in range(len(self.names)))
        return sum(weights[loop] for loop, name in zip(innermost, self.names, strict=True) if is_vector(name))


def is_vector(name: str) -> bool:
    """Return whether an instruction runs for each invocation of a subgroup, with separate registers."""
    return not name.startswith("s_")
