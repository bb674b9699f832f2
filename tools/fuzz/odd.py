"""Odd objects as arguments. Each call of armlet must accept or refuse them without a fault. A snippet imports them by name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np


class Huge:
    """A sequence whose length is reported as 2^62."""

    def __len__(self) -> int:
        return 2**62

    def __getitem__(self, index: int) -> float:
        return 1.0


class Endless:
    """A sequence without a length and without an end."""

    def __getitem__(self, index: int) -> float:
        return 0.0


class Shrinking:
    """A sequence whose reported length is larger than its number of entries."""

    def __len__(self) -> int:
        return 3

    def __iter__(self) -> Iterator[float]:
        return iter([1.0])

    def __getitem__(self, index: int) -> float:
        if index:
            raise IndexError(index)
        return 1.0


class Same:
    """An object that compares equal to every object."""

    def __eq__(self, other: object) -> bool:
        return True

    def __hash__(self) -> int:
        return 0


class Subclass(np.ndarray[Any, Any]):
    """A subclass of numpy's array."""


def loop() -> list[Any]:
    """A list that contains itself."""
    made: list[Any] = [0.0]
    made.append(made)
    return made


def deep(depth: int = 5000) -> Any:
    """A list nested to this depth."""
    made: Any = 0.0
    for _ in range(depth):
        made = [made]
    return made


def deep_dict(depth: int = 5000) -> Any:
    """A dict nested to this depth."""
    made: Any = {}
    for _ in range(depth):
        made = {"arm": made}
    return made
