"""The common parts of all figures: the colours of Okabe and Ito (for colour-blind readers), the style, and the figure object.

matplotlib is an optional package. This module imports it only when a function needs it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ..arguments import one_line, shown
from ..errors import InputError
from ..extras import missing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["COLOURS", "available", "legend_below", "literal", "require", "sheet"]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
STYLE = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 10,
    "axes.labelsize": 9,
    "font.size": 9,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.6,
    "legend.fontsize": 8,
    "legend.framealpha": 0.85,
    "legend.edgecolor": "none",
    "lines.linewidth": 1.4,
    # TeX is off, because names come from files and TeX commands in a name could read other files.
    "text.usetex": False,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
}


def available() -> bool:
    """Whether matplotlib can be imported."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        return False
    return True


def require(caller: str) -> None:
    """Require matplotlib.

    Raises:
        ImportError: matplotlib is not installed; the message begins with `caller`.
    """
    if not available():
        raise missing(caller, "matplotlib", "plot")


def literal(text: str) -> str:
    """Convert a name from a file to a label: matplotlib then draws it on one line, without mathematics, and does not hide it."""
    line = one_line(text)
    return (" " if line.startswith("_") else "") + line.replace("$", r"\$")


@contextmanager
def sheet(fig: Figure | None, size: tuple[float, float] | None) -> Iterator[Figure]:
    """Apply the style, and yield `fig`, or a new pyplot figure if it is None. `size` is in inches (None: unchanged)."""
    import matplotlib
    from matplotlib.figure import FigureBase

    if fig is not None and not isinstance(fig, FigureBase):
        raise InputError(f"plot: fig is of the wrong type: expected a figure of matplotlib or None, got {shown(fig)}")
    if fig is None:
        from matplotlib import pyplot

        # The first figure loads the backend. The backend of a notebook then changes settings, which `rc_context` must not reset.
        fig = pyplot.figure()
    with matplotlib.rc_context(STYLE):  # type: ignore[arg-type]  # keys are rc names
        if size is not None:
            fig.set_size_inches(size)
            fig.set_layout_engine("constrained")
        yield fig


def legend_below(figure: Figure, handles: Sequence[Any], title: str | None = None) -> None:
    """Draw a legend of `handles`, which have labels, below all axes. It covers no data, and no title of the figure.

    All rows but the last have an equal number of entries, as many as fit in the width of the figure.
    """
    if not handles:
        return
    # At 8 points a letter is about 1/15 inch wide, and an entry has a line and a gap of about five letters.
    most = int(15.0 * figure.get_figwidth() / (5 + max(len(handle.get_label()) for handle in handles)))
    rows = -(-len(handles) // max(1, most))
    columns = -(-len(handles) // rows)
    # matplotlib fills columns first. This order fills rows first.
    order = [handles[i] for first in range(columns) for i in range(first, len(handles), columns)]
    figure.legend(handles=order, loc="outside lower center", ncols=columns, title=title, handlelength=1.4)
