"""The lines of a listed program, and their text. A *program* is straight-line code for a loop. A line is one operation,
`name = kind(operands)`."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["Instruction", "Listing"]

# Text of an operation by kind. A kind that is not in this table is written as a function call.
INFIX = {
    "add": "{} + {}",
    "sub": "{} - {}",
    "mul": "{} * {}",
    "div": "{} / {}",
    "neg": "-{}",
    "fma": "{0} * {1} + {2}",
    "fms": "{0} * {1} - {2}",
    "fnma": "{2} - {0} * {1}",
    "fnms": "-{0} * {1} - {2}",
    "less": "{} < {}",
    "and": "{} & {}",
    "andnot": "~{} & {}",
    "or": "{} | {}",
    "xor": "{} ^ {}",
    "shift": "{} << {}",
}


class Instruction(NamedTuple):
    """One line of a program: `name = kind(operands)`. An operand is the name of an earlier line, of an input, or a number."""

    name: str
    kind: str
    operands: tuple[str, ...]

    def __str__(self) -> str:
        if self.kind in ("load", "move", "store"):
            return f"{self.name} = {self.operands[0]}"
        if self.kind not in INFIX:
            return f"{self.name} = {self.kind}({', '.join(self.operands)})"
        operands = [f"({operand})" if operand.startswith("-") else operand for operand in self.operands]
        return f"{self.name} = {INFIX[self.kind].format(*operands)}"


class Listing(NamedTuple):
    """The lines of a program at one stage of its compilation, and one pair `(output, value)` per output."""

    instructions: tuple[Instruction, ...]
    outputs: tuple[tuple[str, str], ...]
