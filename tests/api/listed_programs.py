"""An interpreter in Python for the lines of a `LoopProgram`. It computes with numbers, and for some kinds of lines with their bits."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from fractions import Fraction

import armlet as al

ONES = 2**64 - 1


def bits(x: float) -> int:
    return int(struct.unpack("<Q", struct.pack("<d", x))[0])


def of_bits(word: int) -> float:
    return float(struct.unpack("<d", struct.pack("<Q", word & ONES))[0])


def fused(a: float, b: float, c: float) -> float:
    """The value a b + c with one rounding: the exact fraction is converted to the nearest float."""
    if not all(map(math.isfinite, (a, b, c))):
        return a * b + c
    exact = Fraction(a) * Fraction(b) + Fraction(c)
    return float(exact) if exact else a * b + c


def logic(f: Callable[[int, int], int]) -> Callable[[float, float], float]:
    return lambda a, b: of_bits(f(bits(a), bits(b)))


KINDS: dict[str, Callable[..., float]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "fma": fused,
    "fms": lambda a, b, c: fused(a, b, -c),
    "fnma": lambda a, b, c: fused(-a, b, c),
    "fnms": lambda a, b, c: fused(-a, b, -c),
    "sqrt": math.sqrt,
    "abs": abs,
    "max": lambda a, b: b if a < b else a,
    "min": lambda a, b: b if b < a else a,
    "sin": math.sin,
    "cos": math.cos,
    "less": lambda a, b: of_bits(ONES if a < b else 0),
    "select": lambda mask, yes, no: yes if bits(mask) >> 63 else no,
    "signs": lambda a: of_bits(ONES if bits(a) >> 63 else 0),
    "and": logic(lambda a, b: a & b),
    "andnot": logic(lambda a, b: ~a & b),
    "or": logic(lambda a, b: a | b),
    "xor": logic(lambda a, b: a ^ b),
    "shift": lambda a, by: of_bits(bits(a) << int(by)),
    "load": lambda a: a,
    "store": lambda a: a,
    "move": lambda a: a,
}


def evaluate(program: al.LoopProgram, inputs: Mapping[str, float]) -> dict[str, float]:
    """Evaluate a program and return its outputs. `inputs` contains the inputs that change during a run."""
    known = {name: inputs[name] if value is None else value for name, value in program.inputs.items()}

    def value(name: str) -> float:
        return known[name] if name in known else float(name)

    for line in program.instructions:
        known[line.name] = KINDS[line.kind](*(value(operand) for operand in line.operands))
    return {output: value(name) for output, name in program.outputs.items()}
