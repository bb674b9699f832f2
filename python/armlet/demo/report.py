"""The report of a demonstration: checks, printed in one section per system, and figures."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from ..files import folder_for, write_whole
from .checks import Check, Section
from .html import page

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure


__all__ = ["Report"]


def _table(checks: list[tuple[str, str, str, str]]) -> list[str]:
    """Return the lines of a table. In a narrow terminal the values are in the line below their claim."""
    rows = [("what", "expected", "got", "verdict"), *checks]
    widths = [max(len(row[i]) for row in rows) for i in range(4)]
    if sys.stdout.isatty() and shutil.get_terminal_size().columns < sum(widths) + 8:
        pairs = [(f"  {check[3]:<6}  {check[0]}", f"{'':10}expected {check[1]}, got {check[2]}") for check in checks]
        return [line for pair in pairs for line in pair]
    lines = ["  " + "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return [lines[0], "  " + "  ".join("-" * width for width in widths), *lines[1:]]


class Drawing(Protocol):
    """An object that can be drawn, such as a run or a problem."""

    def plot(self, fig: Figure, /) -> Any: ...


class Report:
    """Collect checks and figures in sections, and print the table of each section when it ends.

    Args:
        out: folder of the figures and of the page. It is created if it does not exist.
        figures: whether to draw figures. It must be False if matplotlib is not installed.
    """

    def __init__(self, out: Path, *, figures: bool = True) -> None:
        self.out = folder_for(out)
        self.draw = figures
        self.sections: list[Section] = []

    @property
    def checks(self) -> list[Check]:
        return [check for section in self.sections for check in section.checks]

    @property
    def failed(self) -> list[Check]:
        return [check for check in self.checks if not check.passed]

    @property
    def figures(self) -> list[Path]:
        return [path for section in self.sections for path in section.figures]

    def section(self, title: str) -> None:
        self.sections.append(Section(title))
        print(f"\n{title}", flush=True)

    def near(self, what: str, expected: Any, got: Any, tolerance: float, printed: str = "", erratum: str = "") -> None:
        """Add the claim |got - expected| <= tolerance, for each entry."""
        self._add(Check(what, expected, got, tolerance, printed, erratum))

    def bound(self, what: str, got: Any, limit: float) -> None:
        """Add the claim |got| <= limit."""
        self._add(Check(what, None, got, limit))

    def equal(self, what: str, expected: Any, got: Any, printed: str = "", erratum: str = "") -> None:
        """Add the claim got == expected."""
        self._add(Check(what, expected, got, 0.0, printed, erratum))

    def figure(self, name: str, run: Drawing) -> None:
        """Write the figure of a run or of a problem to `out/name.png`."""
        self.draw_figure(name, run.plot)

    def draw_figure(self, name: str, draw: Callable[[Figure], Any]) -> None:
        """Call `draw` with an empty matplotlib figure and write the figure to `out/name.png`."""
        if not self.draw:
            return
        from matplotlib.figure import Figure

        figure = Figure()
        draw(figure)
        path = self.out / f"{name}.png"
        write_whole(path, lambda file: figure.savefig(file, format="png", dpi=150))
        self.sections[-1].figures.append(path)

    def write_page(self, build: str) -> Path:
        """Write the report as one HTML file."""
        path = self.out / "report.html"
        write_whole(path, lambda file: file.write(page(self.sections, build).encode()))
        return path

    def _add(self, check: Check) -> None:
        checks = self.sections[-1].checks
        checks.append(check)
        if sys.stderr.isatty():
            print(f"\r  {len(checks)} checks", end="\r", file=sys.stderr, flush=True)

    def close_section(self, seconds: float) -> None:
        """Print the table of the section's checks."""
        section = self.sections[-1]
        section.seconds = seconds
        for line in _table([check.columns() for check in section.checks]):
            print(line)
        passed = sum(check.passed for check in section.checks)
        print(f"  {passed} of {len(section.checks)} checks hold, {seconds:.2f} s", flush=True)
