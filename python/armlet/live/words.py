"""Text on a page. Names come from files, and viser's markdown renders raw HTML. So only this file passes markdown to viser.

    page = strong + plain,   both with all special characters of markdown and HTML escaped

Labels, options and titles of viser are plain text and need no escape.
"""

from __future__ import annotations

import re
from typing import Any

from ..arguments import one_line

__all__ = ["Words", "escaped"]

# All punctuation of ASCII. In markdown a backslash before any of these characters makes it literal [CommonMark 2.4].
MARKS = re.compile(r"([!-/:-@\[-`{-~])")


def escaped(text: str) -> str:
    """Return `one_line(text)` as markdown with every special character escaped."""
    return MARKS.sub(r"\\\1", one_line(text))


class Words:
    """Paragraphs on a page. A paragraph is a text, or a pair of a strong text and the rest.

    Attributes:
        shown: the visible text, one line per paragraph.
    """

    def __init__(self, gui: Any, *paragraphs: str | tuple[str, str]) -> None:
        self.shown = ""
        self.handle = gui.add_markdown("")
        self.show(*paragraphs)

    def show(self, *paragraphs: str | tuple[str, str]) -> None:
        """Replace the paragraphs. Empty paragraphs are omitted."""
        pairs = [("", part) if isinstance(part, str) else part for part in paragraphs if part]
        self.shown = "\n".join(one_line(strong + rest) for strong, rest in pairs)
        self.handle.content = "\n\n".join((f"**{escaped(strong)}**" if strong else "") + escaped(rest) for strong, rest in pairs)
