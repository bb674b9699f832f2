"""Checks with a computed verdict, and sections, which collect the checks of a system."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["Check", "Section"]


@dataclass(frozen=True)
class Check:
    """One claim and its result.

    Attributes:
        what: the claim, in words.
        expected: the correct value: a number, a boolean, an array or a text. None: the claim is |got| <= tolerance.
        got: the value that armlet computed.
        tolerance: largest allowed absolute deviation; 0 for values that must be equal.
        printed: the value of the exam's printed solution, if it differs from `expected`.
        erratum: the number of the erratum about this difference, "E1" and so on; "" if there is none.
    """

    what: str
    expected: Any
    got: Any
    tolerance: float = 0.0
    printed: str = ""
    erratum: str = ""

    @property
    def passed(self) -> bool:
        """Whether the claim is true. A claim about NaN is never true."""
        if isinstance(self.got, str) or isinstance(self.expected, str):
            return bool(self.got == self.expected)
        expected = 0.0 if self.expected is None else self.expected
        if np.shape(expected) not in ((), np.shape(self.got)) or np.size(self.got) == 0:
            return False
        deviation = np.abs(np.asarray(self.got, dtype=np.float64) - np.asarray(expected, dtype=np.float64))
        return bool(np.all(deviation <= self.tolerance))

    @property
    def verdict(self) -> str:
        return "ok" if self.passed else "FAILED"

    def columns(self) -> tuple[str, str, str, str]:
        """Claim, expected value, actual value and verdict as texts."""
        what = f"{self.what} [{self.erratum}, printed: {self.printed}]" if self.erratum else self.what
        if self.expected is None:
            return what, f"<= {self.tolerance:g}", _text(self.got, 2), self.verdict
        bound = f" +- {self.tolerance:g}" if self.tolerance else ""
        return what, _text(self.expected, zero=self.tolerance) + bound, _text(self.got, zero=self.tolerance), self.verdict


def _text(value: Any, digits: int = 6, zero: float = 0.0) -> str:
    """Return a value as a short text. Magnitudes below `zero` become "0"."""
    if isinstance(value, str):
        return value
    array = np.asarray(value)
    if array.ndim:
        return "(" + ", ".join(_text(x, digits, zero) for x in array) + ")"
    if array.dtype == bool:
        return "yes" if array else "no"
    if array.dtype.kind not in "iuf":
        return str(value)
    return "0" if abs(array) < zero else f"{float(array):.{digits}g}"


@dataclass
class Section:
    """The checks and figures of one system."""

    title: str
    checks: list[Check] = field(default_factory=list)
    figures: list[Path] = field(default_factory=list)
    seconds: float = 0.0
