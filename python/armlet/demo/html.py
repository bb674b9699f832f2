"""The report of a demonstration as one HTML file with all tables and figures, in the style of `armlet.reports`."""

from __future__ import annotations

from html import escape

from ..reports.page import document, image
from .checks import Section

__all__ = ["page"]


def _section(section: Section) -> str:
    rows = []
    for check in section.checks:
        what, expected, got, verdict = (escape(text) for text in check.columns())
        rows.append(
            f'<tr><td class="what">{what}</td><td class="number" data-label="expected">{expected}</td>'
            f'<td class="number" data-label="got">{got}</td><td class="verdict {verdict}">{verdict}</td></tr>'
        )
    head = "<tr><th>what</th><th>expected</th><th>got</th><th>verdict</th></tr>"
    figures = [image(path.read_bytes(), f"{section.title}: {path.stem}") for path in section.figures]
    passed = sum(check.passed for check in section.checks)
    lines = [
        f"<section><h2>{escape(section.title)}</h2>",
        f"<p>{passed} of {len(section.checks)} checks hold, {section.seconds:.2f} s</p>",
        f'<div class="wide"><table class="checks"><thead>{head}</thead><tbody>',
        *rows,
        "</tbody></table></div>",
        *figures,
        "</section>\n",
    ]
    return "\n".join(lines)


def page(sections: list[Section], build: str) -> str:
    """Return the whole HTML page. `build` describes version, instruction set and machine."""
    passed = [check.passed for section in sections for check in section.checks]
    verdict = f"{sum(passed)} of {len(passed)} checks hold"
    colour = "ok" if all(passed) else "FAILED"
    head = ["<h1>armlet demo</h1>", f'<p class="{colour}">{escape(verdict)}</p>', f"<p><small>{escape(build)}</small></p>"]
    return document(f"armlet demo: {verdict}", [*head, *map(_section, sections)])
