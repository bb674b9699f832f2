"""`python tools/reference.py`: write the entries of `docs/reference.md`, one per public name: a link and its first sentence.

The page has the names, their sections and their order. A new name is an entry `- [name]()`. `--pages FILE` converts the entries of a copy
of the page to the lists of Sphinx, from which `make docs` makes a page per name.
"""

from __future__ import annotations

import inspect
import re
import sys
import textwrap
from pathlib import Path

import armlet

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/reference.md"
ENTRY = re.compile(r"^- \[`?(\w+)`?\]\([^)]*\).*\n(?:  .*\n)*", re.MULTILINE)
LIST = """```{{eval-rst}}
.. currentmodule:: armlet

.. autosummary::
   :toctree: api
   :nosignatures:

{names}
```
"""


def source(name: str) -> Path:
    """The file that has the docstring of a public name: a stub of the extension, or a Python file."""
    if getattr(armlet._core, name, None) is getattr(armlet, name):
        defined = re.compile(rf"^(?:class|def) {name}\b", re.MULTILINE)
        return next(stub for stub in sorted((ROOT / "python/armlet/_core").glob("*.pyi")) if defined.search(stub.read_text()))
    module = inspect.unwrap(getattr(armlet, name)).__module__
    return next(path for end in (".py", "/__init__.py") if (path := ROOT / f"python/{module.replace('.', '/')}{end}").exists())


def entry(name: str) -> str:
    """The entry of a name. Its sentence ends at the first period before a space."""
    text = " ".join((inspect.getdoc(getattr(armlet, name)) or "").split("\n\n")[0].split())
    sentence = re.split(r"(?<=\.)\s", text)[0]
    line = f"- [`{name}`](../{source(name).relative_to(ROOT).as_posix()}): {sentence}"
    return textwrap.fill(line, 160, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False) + "\n"


def written(page: str) -> str:
    """The page with new entries."""
    return ENTRY.sub(lambda found: entry(found[1]), page)


def converted(page: str) -> str:
    """The page with a list of Sphinx in place of the entries of each section."""

    def names(found: re.Match[str]) -> str:
        return LIST.format(names="\n".join(f"   {entry[1]}" for entry in ENTRY.finditer(found[0])))

    return re.sub(rf"(?:{ENTRY.pattern})+", names, page, flags=re.MULTILINE)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--pages"]:
        copy = Path(sys.argv[2])
        copy.write_text(converted(copy.read_text()))
    else:
        PAGE.write_text(written(PAGE.read_text()))
