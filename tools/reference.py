"""`python tools/reference.py`: write the entries of `docs/reference.md`, one per public name: a link and its first sentence.

The page has the names, their sections and their order. A new name is an entry `- [name]()`. `--pages FILE` converts the entries of a copy
of the page to the lists of Sphinx, from which `make docs` makes a page per name.
"""

from __future__ import annotations

import ast
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


def source(name: str) -> tuple[Path, str]:
    """The file that has the docstring of a public name, a stub of the extension or a Python file, and the docstring."""
    if getattr(armlet._core, name, None) is getattr(armlet, name):
        for stub in sorted((ROOT / "python/armlet/_core").glob("*.pyi")):
            for node in ast.parse(stub.read_text()).body:
                if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == name:
                    return stub, ast.get_docstring(node) or ""
    made = inspect.unwrap(getattr(armlet, name))
    stem = ROOT / f"python/{made.__module__.replace('.', '/')}"
    return next(path for path in (stem.with_suffix(".py"), stem / "__init__.py") if path.exists()), inspect.getdoc(made) or ""


def entry(name: str) -> str:
    """The entry of a name. Its sentence ends at the first period before a space."""
    file, text = source(name)
    sentence = re.split(r"(?<=\.)\s", " ".join(text.split("\n\n")[0].split()))[0]
    line = f"- [`{name}`](../{file.relative_to(ROOT).as_posix()}): {sentence}"
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
