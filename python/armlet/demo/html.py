"""The report of a demonstration as one HTML file with all tables and figures.

The page is readable offline, on a phone, and in light and dark mode.
"""

from __future__ import annotations

from base64 import b64encode
from html import escape

from .checks import Section

__all__ = ["page"]

STYLE = """
:root { color-scheme: light dark; --line: #8884; --bad: #b3261e; --good: #00734f; }
@media (prefers-color-scheme: dark) { :root { --bad: #ff8a80; --good: #5fd7a8; } }
body { font: 16px/1.45 system-ui, sans-serif; margin: 0 auto; max-width: 70rem; padding: 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
.wide { overflow-x: auto; }

table { border-collapse: collapse; font-size: .875rem; width: 100%; }
th, td { border-bottom: 1px solid var(--line); padding: .35rem .6rem; text-align: left; vertical-align: top; }
td.number { font-family: ui-monospace, monospace; }
.ok { color: var(--good); } .FAILED { color: var(--bad); font-weight: 700; }
td.what { white-space: pre-wrap; }
figure { margin: 1rem 0 0; overflow-x: auto; }
img { background: #fff; border-radius: .4rem; height: auto; max-width: 100%; }
small { font-size: .875rem; opacity: .75; }

/* On a phone the claim and its verdict share a line, and the values are below. Figures keep a readable size and scroll sideways. */

@media (max-width: 42rem) {
 thead { display: none; }
 tr { border-bottom: 1px solid var(--line); display: grid; grid-template-columns: 1fr auto; padding: .5rem 0; }
 td { border: 0; padding: .05rem 0; }
 td.number { grid-column: 1 / 3; overflow-wrap: anywhere; padding-left: 4.6rem; text-indent: -4.6rem; }
 td.number::before {
  content: attr(data-label); display: inline-block; font-family: system-ui, sans-serif; opacity: .75; text-indent: 0; width: 4.6rem;
 }
 td.verdict { grid-column: 2; grid-row: 1; padding-left: .8rem; }
 img { max-width: none; width: 46rem; }
}
"""


def _section(section: Section) -> str:
    rows = []
    for check in section.checks:
        what, expected, got, verdict = (escape(text) for text in check.columns())
        rows.append(
            f'<tr><td class="what">{what}</td><td class="number" data-label="expected">{expected}</td>'
            f'<td class="number" data-label="got">{got}</td><td class="verdict {verdict}">{verdict}</td></tr>'
        )
    head = "<tr><th>what</th><th>expected</th><th>got</th><th>verdict</th></tr>"
    figures = [
        f'<figure><img alt="{escape(section.title)}: {escape(path.stem)}" '
        f'src="data:image/png;base64,{b64encode(path.read_bytes()).decode()}"></figure>'
        for path in section.figures
    ]
    passed = sum(check.passed for check in section.checks)
    lines = [
        f"<section><h2>{escape(section.title)}</h2>",
        f"<p>{passed} of {len(section.checks)} checks hold, {section.seconds:.2f} s</p>",
        f'<div class="wide"><table><thead>{head}</thead><tbody>',
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
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>armlet demo: {escape(verdict)}</title><style>{STYLE}</style></head><body>\n"
        f'<h1>armlet demo</h1>\n<p class="{colour}">{escape(verdict)}</p>\n<p><small>{escape(build)}</small></p>\n'
        + "".join(_section(section) for section in sections)
        + "</body></html>\n"
    )
