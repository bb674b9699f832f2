"""Boxes of the texts of a figure: which ones overlap, which ones are cut off, and which axes have no unit."""

from __future__ import annotations

import re
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d.art3d import Text3D
from mpl_toolkits.mplot3d.proj3d import proj_transform

#: A label ends with a unit in parentheses, such as "time (s)", or names a number without a unit.
UNIT = re.compile(r"(?:\([^()]+\)|in parts of its limits?)$")
#: A tick label that is a number, such as "-0.5" or "$\\mathdefault{10^{-2}}$".
NUMBER = re.compile(r"[\s$\d.+\-\u2212^{}]*(?:\\mathdefault)?[\s$\d.+\-\u2212^{}]*\d[\s$\d.+\-\u2212^{}]*")
#: Two boxes may share this many pixels, because a box is larger than its letters.
SHARED = 1.0


def texts(figure: Figure) -> list[Text]:
    """The visible texts of a drawn figure."""
    shown = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip() and text.get_alpha() != 0]
    # Texts of hidden axes, and tick labels outside of the limits, are not drawn.
    drawn = [text for text in shown if text.axes is None or text.axes.get_visible()]
    hidden = {id(label) for ax in figure.axes for _, axis in axes_of(ax) for label in _labels_not_drawn(axis)}
    return [text for text in drawn if id(text) not in hidden]


def _labels_not_drawn(axis: object) -> list[Text]:
    ticks = [*axis.majorTicks, *axis.minorTicks]  # type: ignore[attr-defined]
    drawn = {id(tick) for tick in axis._update_ticks()} if axis.get_visible() and axis.axes.axison else set()  # type: ignore[attr-defined]
    labels = [label for tick in ticks if id(tick) not in drawn for label in (tick.label1, tick.label2)]
    offset = axis.offsetText  # type: ignore[attr-defined]
    return labels if id(axis) in drawn or drawn else [*labels, offset]


def axes_of(ax: Axes) -> list[tuple[str, Any]]:
    """The two axes of a plane, or the three of space, with their letters."""
    return [(letter, getattr(ax, f"{letter}axis")) for letter in "xyz" if hasattr(ax, f"{letter}axis")]


def box_of(text: Text) -> Bbox:
    """The box of a drawn text. matplotlib computes that of a text in space from its coordinates, as if they were in the picture."""
    if not isinstance(text, Text3D):
        return text.get_window_extent()
    at = text.get_position_3d()
    x, y, _ = proj_transform(*at, text.axes.get_proj())
    try:
        text.set_position((x, y))
        return Text.get_window_extent(text)
    finally:
        text.set_position_3d(at)


def faults(figure: Figure) -> list[str]:
    """The faults of a figure: texts that overlap, texts that are cut off, and axes without a unit."""
    figure.draw_without_rendering()
    found = []
    boxes = [(text, box_of(text)) for text in texts(figure)]
    for i, (text, box) in enumerate(boxes):
        if box.x0 < -1.0 or box.y0 < -1.0 or box.x1 > figure.bbox.x1 + 1.0 or box.y1 > figure.bbox.y1 + 1.0:
            found.append(f"cut off: {text.get_text()!r}")
        for other, second in boxes[i + 1 :]:
            width = min(box.x1, second.x1) - max(box.x0, second.x0)
            height = min(box.y1, second.y1) - max(box.y0, second.y0)
            if width > SHARED and height > SHARED and not isinstance(text, Annotation) | isinstance(other, Annotation):
                found.append(f"overlap: {text.get_text()!r} and {other.get_text()!r}")
    return found + [fault for ax in figure.axes if ax.get_visible() and ax.axison for fault in units(ax)]


def units(ax: Axes) -> list[str]:
    """The axes that show numbers and have no unit. Axes whose ticks are names need none."""
    found = []
    for which, axis in axes_of(ax):
        numbers = [tick.label1.get_text() for tick in axis.get_major_ticks() if tick.label1.get_visible() and tick.label1.get_text()]
        numbers += [tick.label2.get_text() for tick in axis.get_major_ticks() if tick.label2.get_visible() and tick.label2.get_text()]
        if any(NUMBER.fullmatch(text) for text in numbers) and not UNIT.search(axis.get_label_text()):
            found.append(f"no unit: {which} axis {axis.get_label_text()!r} of {ax.get_title(loc='left') or ax.get_title()!r}")
    return found
