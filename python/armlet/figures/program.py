"""The figure of a program, the straight-line code of a loop: its data flow from left to right, one column per depth.

A *line* is one operation of the program. Its *depth* is the length of the longest chain of lines that ends with it. A *node* of the figure
is a line, an input, an output or an intermediate point of an edge. An edge to a distant column has such points, so that it passes around
other nodes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .style import COLOURS, literal, require, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..run.instructions import Listing

__all__ = ["plot"]

LIMIT = 300
SWEEPS = 24
SIGNS = {"add": "+", "sub": "−", "mul": "×", "div": "÷", "neg": "−", "fma": "×+", "fms": "×−", "fnma": "−×", "fnms": "−×−"}
# The colours of groups of operations.
GROUPS = {
    "sums": (COLOURS[0], {"add", "sub", "neg", "abs", "max", "min"}),
    "products": (COLOURS[2], {"mul"}),
    "product and sum, rounded once": (COLOURS[4], {"fma", "fms", "fnma", "fnms"}),
    "quotients and roots": (COLOURS[1], {"div", "sqrt"}),
    "sine and cosine": (COLOURS[3], {"sin", "cos"}),
    "bits, choices and moves": (COLOURS[7], set[str]()),
}


class Flow:
    """The nodes of the figure, with their columns and their preceding nodes.

    The nodes are lines, inputs at the columns where they are read, outputs, and intermediate nodes of long edges.
    """

    def __init__(self, listing: Listing) -> None:
        self.label: list[str] = []
        self.kind: list[str] = []
        self.column: list[int] = []
        self.before: list[list[int]] = []
        self.leaves: dict[tuple[str, int], int] = {}
        self.led: dict[tuple[int, int], int] = {}
        made: dict[str, int] = {}
        depth: dict[str, int] = {}
        for line in listing.instructions:
            column = 1 + max((depth.get(operand, 0) for operand in line.operands), default=0)
            reads = [self._read(operand, column, made) for operand in line.operands]
            made[line.name], depth[line.name] = self._node(SIGNS.get(line.kind, line.kind), line.kind, column, reads), column
        last = 1 + max(self.column, default=0)
        for output, value in listing.outputs:
            self._node(output, "output", last, [self._read(value, last, made)])
        self.chain = self._chain()

    def _node(self, label: str, kind: str, column: int, before: list[int]) -> int:
        self.label.append(label)
        self.kind.append(kind)
        self.column.append(column)
        self.before.append(before)
        return len(self.label) - 1

    def _read(self, operand: str, column: int, made: dict[str, int]) -> int:
        """The node in the preceding column from which a line in `column` reads its operand."""
        if operand not in made:
            key = (operand, column - 1)
            if key not in self.leaves:
                self.leaves[key] = self._node(operand, "input", column - 1, [])
            return self.leaves[key]
        at = source = made[operand]
        for between in range(self.column[source] + 1, column):
            if (source, between) not in self.led:
                self.led[source, between] = self._node("", "led", between, [at])
            at = self.led[source, between]
        return at

    def _chain(self) -> set[tuple[int, int]]:
        """The edges of one longest chain of dependent lines, including the edge to the output."""
        outputs = [node for node, kind in enumerate(self.kind) if kind == "output"]
        chain: set[tuple[int, int]] = set()
        at = max(outputs, key=lambda node: max((self._waits(b) for b in self.before[node]), default=False), default=None)
        while at is not None:
            before = next((b for b in self.before[at] if self._waits(b)), None)
            if before is not None:
                chain.add((before, at))
            at = before
        return chain

    def _waits(self, node: int) -> bool:
        """Whether a node is a line or an output, not an input or an intermediate node."""
        return self.kind[node] not in ("input", "led")


def _heights(flow: Flow) -> list[float]:
    """The vertical position of each node, near the mean of its neighbours. Positions in a column differ by at least one."""
    columns: list[list[int]] = [[] for _ in range(1 + max(flow.column, default=0))]
    after: list[list[int]] = [[] for _ in flow.label]
    for node, column in enumerate(flow.column):
        columns[column].append(node)
        for before in flow.before[node]:
            after[before].append(node)
    heights = [0.0] * len(flow.label)
    for nodes in columns:
        for place, node in enumerate(nodes):
            heights[node] = place - (len(nodes) - 1) / 2
    for sweep in range(SWEEPS):
        for nodes in columns if sweep % 2 else reversed(columns):
            wanted = {}
            for node in nodes:
                near = flow.before[node] + after[node]
                wanted[node] = sum(heights[other] for other in near) / len(near) if near else heights[node]
            nodes.sort(key=lambda node: wanted[node])
            for node, height in zip(nodes, _apart([wanted[node] for node in nodes]), strict=True):
                heights[node] = height
    return heights


def _apart(wanted: list[float]) -> list[float]:
    """Positions as near as possible to the increasing positions `wanted`, with distances of at least one between neighbours.

    Neighbours that are too close form a block, which moves as a whole (isotonic regression).
    """
    blocks: list[list[float]] = []  # for each block: the sum of (wanted position - index) over its nodes, and their number
    for place, height in enumerate(wanted):
        blocks.append([height - place, 1.0])
        while len(blocks) > 1 and blocks[-2][0] / blocks[-2][1] >= blocks[-1][0] / blocks[-1][1]:
            total, count = blocks.pop()
            blocks[-1][0] += total
            blocks[-1][1] += count
    levels = [total / count for total, count in blocks for _ in range(int(count))]
    return [level + place for place, level in enumerate(levels)]


def _curve(x0: float, y0: float, x1: float, y1: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """The points of a curve from (x0, y0) to (x1, y1) that is horizontal at both ends."""
    s = np.linspace(0.0, 1.0, 17)
    return x0 + (x1 - x0) * s, y0 + (y1 - y0) * s * s * (3.0 - 2.0 * s)


def _short(name: str) -> str:
    """The drawn text of an input or output: its name, or a number with four digits."""
    try:
        return f"{float(name):.4g}"
    except ValueError:
        return literal(name)


def _colour(kind: str) -> str:
    return next((colour for colour, kinds in GROUPS.values() if kind in kinds), COLOURS[7])


def plot(listing: Listing, stage: str, title: str, fig: Figure | None = None) -> Axes:
    """Draw a program, for `LoopProgram.plot`."""
    lines = len(listing.instructions)
    if lines > LIMIT:
        problem = f"expected at most {LIMIT} lines, got {lines} at stage {stage}"
        raise InputError(f"LoopProgram.plot: the program is too long for a figure: {problem}")
    require("LoopProgram.plot")
    flow = Flow(listing)
    heights = _heights(flow)
    wide, high = max(flow.column, default=0) + 1, max(heights, default=0.0) - min(heights, default=0.0) + 1
    with sheet(fig, (max(4.0, 0.62 * wide + 0.8), max(2.6, 0.36 * high + 1.2))) as figure:
        ax = figure.subplots()
        for node, reads in enumerate(flow.before):
            for before in reads:
                bold = (before, node) in flow.chain
                curve = _curve(flow.column[before], heights[before], flow.column[node], heights[node])
                ax.plot(*curve, color="0.1" if bold else "0.7", linewidth=1.8 if bold else 0.8, zorder=2 if bold else 1)
        seen = set()
        for node, kind in enumerate(flow.kind):
            x, y = flow.column[node], heights[node]
            if kind == "led":
                continue
            if kind in ("input", "output"):
                side = "right" if kind == "input" else "left"
                shift = 0.12 if kind == "input" else -0.12
                ax.text(x + shift, y, _short(flow.label[node]), ha=side, va="center", fontsize=7, zorder=3, backgroundcolor="white")
                continue
            colour = _colour(kind)
            seen.add(colour)
            ax.plot(x, y, "o", color=colour, markersize=15, zorder=3)
            ax.text(x, y, flow.label[node], ha="center", va="center", color="white", fontsize=7, zorder=4)
        for name, (colour, _) in GROUPS.items():
            if colour in seen:
                ax.plot([], [], "o", color=colour, label=name)
        ax.plot([], [], color="0.1", linewidth=1.8, label="longest chain")
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.01), ncols=3 if wide > 8 else 2)
        ax.set_title(title)
        ax.set_axis_off()
        ax.margins(x=0.06, y=0.06)
    return ax
