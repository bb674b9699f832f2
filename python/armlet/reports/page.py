"""One HTML page with tables and figures inside, in one style.

The page is readable offline, on a phone, in print, and in light and dark mode. Figures are PNG files in the text, with a description for
readers who hear the page. Tables have captions.
"""

from __future__ import annotations

import platform
from base64 import b64encode
from collections.abc import Callable, Iterable, Sequence
from html import escape
from io import BytesIO
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from ..arguments import file_path, instance, one_line
from ..extras import missing
from ..figures.style import available
from ..files import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["document", "drawn", "figure_section", "image", "section", "table", "versions", "write_report"]

STYLE = """
:root { color-scheme: light dark; --line: #8884; --bad: #b3261e; --good: #00734f; }
@media (prefers-color-scheme: dark) { :root { --bad: #ff8a80; --good: #5fd7a8; } }
body { font: 16px/1.45 system-ui, sans-serif; margin: 0 auto; max-width: 70rem; padding: 1rem; }
h1 { font-size: 1.5rem; overflow-wrap: anywhere; } h2 { font-size: 1.15rem; margin-top: 2rem; }
.wide { overflow-x: auto; }
pre { font-size: .8125rem; overflow-x: auto; }

table { border-collapse: collapse; font-size: .875rem; width: 100%; }
caption { font-size: .875rem; opacity: .75; padding-bottom: .35rem; text-align: left; }
th, td { border-bottom: 1px solid var(--line); padding: .35rem .6rem; text-align: left; vertical-align: top; }
td.number { font-family: ui-monospace, monospace; }
.ok { color: var(--good); } .FAILED { color: var(--bad); font-weight: 700; }
td.what { white-space: pre-wrap; }
figure { margin: 1rem 0 0; overflow-x: auto; }
img { background: #fff; border-radius: .4rem; height: auto; max-width: 100%; }
small { font-size: .875rem; opacity: .75; }

/* On a phone the claim and its verdict share a line, and the values are below. Figures keep a readable size and scroll sideways. */

@media (max-width: 42rem) {
 table.checks thead { display: none; }
 table.checks tr { border-bottom: 1px solid var(--line); display: grid; grid-template-columns: 1fr auto; padding: .5rem 0; }
 table.checks td { border: 0; padding: .05rem 0; }
 table.checks td.number { grid-column: 1 / 3; overflow-wrap: anywhere; padding-left: 4.6rem; text-indent: -4.6rem; }
 table.checks td.number::before {
  content: attr(data-label); display: inline-block; font-family: system-ui, sans-serif; opacity: .75; text-indent: 0; width: 4.6rem;
 }
 table.checks td.verdict { grid-column: 2; grid-row: 1; padding-left: .8rem; }
 img { max-width: none; width: 46rem; }
}

@media print {
 :root { color-scheme: light; }
 body { font-size: 10pt; max-width: none; padding: 0; }
 figure, tr { break-inside: avoid; } h2 { break-after: avoid; }
 .wide, figure { overflow: visible; } img { max-width: 100%; width: auto; }
 pre { white-space: pre-wrap; }
}
"""


def document(title: str, body: Iterable[str]) -> str:
    """Return a page. `title` is plain text, and `body` are pieces of HTML."""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{STYLE}</style></head><body>\n" + "\n".join(body) + "\n</body></html>\n"
    )


def section(title: str, *body: str) -> str:
    """Return a section. `title` is plain text, and `body` are pieces of HTML."""
    return "\n".join([f"<section><h2>{escape(title)}</h2>", *body, "</section>"])


def table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of plain texts. The first entry of a row is its header. The entries "ok" and "FAILED" have colours."""
    lines = ["<tr>" + "".join(f'<th scope="col">{escape(each)}</th>' for each in head) + "</tr>"]
    for first, *rest in rows:
        cells = [f'<td class="{each if each in ("ok", "FAILED") else "number"}">{escape(each)}</td>' for each in rest]
        lines.append(f'<tr><th scope="row">{escape(first)}</th>{"".join(cells)}</tr>')
    content = f"<thead>{lines[0]}</thead><tbody>\n" + "\n".join(lines[1:]) + "\n</tbody>"
    return f'<div class="wide"><table><caption>{escape(caption)}</caption>{content}</table></div>'


def image(png: bytes, alt: str) -> str:
    """Return a figure with the bytes of a PNG file, and its description for readers who hear the page."""
    return f'<figure><img alt="{escape(alt)}" src="data:image/png;base64,{b64encode(png).decode()}"></figure>'


def drawn(draw: Callable[[Figure], Any], what: str) -> str:
    """Return the figure that `draw` draws into an empty figure of matplotlib. Its description is `what` and the titles of its panels."""
    from matplotlib.figure import Figure

    figure, file = Figure(), BytesIO()
    draw(figure)
    titles = [ax.get_title(loc="left") or ax.get_title() for ax in figure.axes if ax.get_visible()]
    figure.savefig(file, format="png", dpi=130, facecolor="white")
    return image(file.getvalue(), f"{what}: {', '.join(title for title in titles if title)}")


def versions() -> dict[str, str]:
    """Return the versions of armlet and its requirements, the platform, and how the core was built."""
    rows = {"armlet": _core.__version__, "python": platform.python_version(), "numpy": np.__version__}
    rows |= {"platform": f"{platform.system()} {platform.machine()}"}
    return rows | {name.replace("_", " "): str(value) for name, value in _core.build_info().items() if name != "version"}


def figure_section(draw: Callable[[Figure], Any], what: str) -> str:
    """Return the section with the figure that `draw` makes, as `drawn`. Without matplotlib it is a sentence."""
    if not available():
        return section("Figure", f"<p>{escape(str(missing('no figure', 'matplotlib', 'plot')))}</p>")
    return section("Figure", drawn(draw, what))


def write_report(function: str, path: str | PathLike[str], title: str, body: Iterable[str]) -> None:
    """Write a page with a heading, the sections `body` that are not empty, and the versions. The file is complete or absent."""
    title = one_line(instance(function, "title", title, str, "a text"))
    name = file_path(function, path)
    end = section("Versions", table("Versions and build", ["part", "version"], [[what, value] for what, value in versions().items()]))
    page = document(title, [f"<h1>{escape(title)}</h1>", *(piece for piece in body if piece), end])
    write_whole(name, lambda file: file.write(page.encode("utf-8", "replace")))
