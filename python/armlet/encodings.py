"""The text of an XML file: its encoding by a byte order mark, by its first bytes, or by its declaration `<?xml .. encoding=".."?>`.

Source: XML 1.0, 4.3.3 and appendix F, https://www.w3.org/TR/xml/. A file without mark and declaration is UTF-8.
"""

from __future__ import annotations

import codecs
import re
from contextlib import suppress

__all__ = ["NotText", "decoded"]

# The mark of UTF-32 in this byte order starts with the mark of UTF-16, so it comes first.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_DECLARED = re.compile(rb"""<\?xml\s[^>]{0,200}?encoding\s*=\s*["']([A-Za-z][A-Za-z0-9._-]{0,40})["']""")
# Python's codecs that are no character set. Some of them are slow.
_NO_CHARACTER_SETS = ("idna", "mbcs", "oem", "punycode", "raw-unicode-escape", "undefined", "unicode-escape", "utf-7")


class NotText(ValueError):
    """Bytes are no text in their encoding.

    Attributes:
        line: the line of the first wrong byte, counted from 1.
    """

    def __init__(self, problem: str, line: int) -> None:
        super().__init__(problem)
        self.line = line


def decoded(content: bytes) -> str:
    """Decode an XML file. Line breaks do not change.

    Raises:
        NotText: the bytes are no text in the encoding of the file.
    """
    marked = _marked(content)
    if marked is not None:
        return _text(content, marked)
    match = _DECLARED.search(content[:1024])
    declared = "utf-8" if match is None else _known(match[1].decode("ascii"))
    if declared not in (None, "utf-8"):
        with suppress(NotText):
            text = _text(content, declared)
            # An encoding that does not decode its own declaration is wrong, for example UTF-16 in a file of single bytes.
            if "<?xml" in text[:1024]:
                return text
    # Editors may change the encoding of a file and not its declaration.
    return _text(content, "utf-8")


def _marked(content: bytes) -> str | None:
    """The encoding by the byte order mark, or by a zero byte next to the first character."""
    for mark, name in _MARKS:
        if content.startswith(mark):
            return name
    first = content[:4]
    if len(first) == 4 and 0 in first[:2]:
        if first[0] == 0:
            return "utf-32-be" if first[1] == 0 else "utf-16-be"
        return "utf-32-le" if first[2:] == b"\0\0" else "utf-16-le"
    return None


def _known(name: str) -> str | None:
    """The name of Python's codec for a declared encoding; None if there is none."""
    try:
        known = codecs.lookup(name).name
    except LookupError:
        return None
    return None if known in _NO_CHARACTER_SETS else known


def _text(content: bytes, encoding: str) -> str:
    try:
        text = content.decode(encoding)
        text.encode()  # some decoders make halves of characters
    except (UnicodeError, LookupError) as error:  # LookupError: a codec of Python that is no character set
        start = error.start if isinstance(error, UnicodeDecodeError) else 0
        before = content[:start].decode(encoding, "replace") if start else ""
        name = "UTF-8" if encoding.startswith("utf-8") else encoding.upper()
        raise NotText(f"is not {name} text: expected UTF-8, or the encoding in the first line", 1 + before.count("\n")) from None
    return text
