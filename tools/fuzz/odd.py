"""Objects that no call of armlet is made for; a snippet imports them by name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np


class Huge:
    """A sequence that claims 2^62 entries."""

    def __len__(self) -> int:
        return 2**62

    def __getitem__(self, index: int) -> float:
        return 1.0


class Endless:
    """A sequence without a length whose entries never end."""

    def __getitem__(self, index: int) -> float:
        return 0.0


class Shrinking:
    """A sequence that claims more entries than it has."""

    def __len__(self) -> int:
        return 3

    def __iter__(self) -> Iterator[float]:
        return iter([1.0])

    def __getitem__(self, index: int) -> float:
        if index:
            raise IndexError(index)
        return 1.0


class Same:
    """Equal to everything, of any truth."""

    def __eq__(self, other: object) -> bool:
        return True

    def __hash__(self) -> int:
        return 0


class Subclass(np.ndarray[Any, Any]):
    """An array of a class of its own."""


def loop() -> list[Any]:
    """A list that holds itself."""
    made: list[Any] = [0.0]
    made.append(made)
    return made


def deep(depth: int = 5000) -> Any:
    """A list in a list in a list."""
    made: Any = 0.0
    for _ in range(depth):
        made = [made]
    return made


def deep_dict(depth: int = 5000) -> Any:
    """A table in a table in a table."""
    made: Any = {}
    for _ in range(depth):
        made = {"arm": made}
    return made
