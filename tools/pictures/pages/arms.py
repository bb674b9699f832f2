"""The picture of `docs/arms.md`."""

from __future__ import annotations

from types import SimpleNamespace

from matplotlib.figure import Figure
from registry import result


@result(
    "arms_show.svg",
    "An arm of seven joints with the axes of its joints and of two frames",
    "arms.md",
    "figures/arm.py",
    "figures/skeleton.py",
)
def shown(figure: Figure, page: SimpleNamespace) -> None:
    page.seven.show(page.q_s, frames=["link4", "tcp"], fig=figure)
