"""The list of pictures: who draws a picture, and from what. `docs/images/pictures.toml` has the hashes of the inputs and of the files.

A *drawing* is a schematic picture of a thing. A *result* shows numbers. It is drawn from the names that the code of its page defines above
the picture, so a picture and the code above it always belong together. An *example* is the figure that a script of `examples` draws.
"""

from __future__ import annotations

import hashlib
import inspect
import re
import tomllib
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import cache
from io import StringIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from matplotlib.figure import Figure

__all__ = ["HASHES", "IMAGES", "PICTURES", "ROOT", "Picture", "drawing", "example", "file_hash", "hashes", "result", "stale"]

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ROOT / "docs/images"
HASHES = IMAGES / "pictures.toml"
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
#: The modules that draw the figure of a call, such as `run.plot()`.
PLOTS = {
    "run": {"figures.run", "figures.panels", "figures.estimates"},
    "program": {"figures.program"},
    "log": {"figures.log"},
}
#: Sources that every picture depends on.
STYLE = ("python/armlet/figures/style.py",)


@dataclass(frozen=True)
class Picture:
    """A picture of `docs/images`.

    Attributes:
        name, title: the name of the file, and its title for readers who hear the page.
        inputs: the sources from which it is drawn, relative to the repository.
        page, draw, of_numbers: its page, and the function that draws it with or without the names of the page's code. An example has none.
    """

    name: str
    title: str
    inputs: tuple[str, ...]
    page: str = ""
    draw: Callable[..., None] | None = None
    of_numbers: bool = False

    @property
    def file(self) -> Path:
        return IMAGES / self.name

    def code(self) -> list[str]:
        """The blocks of code above the picture on its page."""
        text = (ROOT / "docs" / self.page).read_text(encoding="utf-8")
        link = re.search(rf"\]\((?:\.\./)?images/{re.escape(self.name)}\)", text)
        if link is None:
            raise ValueError(f"{self.name}: docs/{self.page} does not show this picture")
        return BLOCK.findall(text[: link.start()])

    def hash(self) -> str:
        """The hash of the sources of the picture."""
        parts = [(ROOT / path).read_text(encoding="utf-8") for path in (*STYLE, *self.inputs)]
        parts += self.code() if self.of_numbers else []
        return hashlib.sha256("\0".join([self.title, *parts]).encode()).hexdigest()[:16]

    def figure(self) -> Figure:
        """Draw the picture."""
        figure = Figure()
        assert self.draw is not None
        if self.of_numbers:
            self.draw(figure, SimpleNamespace(**names(tuple(self.code()))))
        else:
            self.draw(figure)
        return figure


@cache
def names(blocks: tuple[str, ...]) -> dict[str, Any]:
    """The names that blocks of code define."""
    if not blocks:
        return {}
    bound = dict(names(blocks[:-1]))
    with redirect_stdout(StringIO()):
        exec(compile(blocks[-1], "block of a page", "exec"), bound)
    return {name: value for name, value in bound.items() if name != "__builtins__"}


PICTURES: dict[str, Picture] = {}


def _add(
    name: str, title: str, page: str, of_numbers: bool, modules: tuple[str, ...] = ()
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    def add(draw: Callable[..., None]) -> Callable[..., None]:
        own = Path(inspect.getfile(draw)).resolve().relative_to(ROOT).as_posix()
        helpers = "tools/pictures/panels.py" if of_numbers else "tools/pictures/sketch.py"
        assert name not in PICTURES
        PICTURES[name] = Picture(name, title, (own, helpers, *(f"python/armlet/{module}" for module in modules)), page, draw, of_numbers)
        return draw

    return add


def drawing(name: str, title: str, page: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Register the function that draws a schematic picture into a figure."""
    return _add(name, title, page, of_numbers=False)


def result(name: str, title: str, page: str, *modules: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Register the function that draws a figure of numbers. Its second argument has the names that the code of the page defines.

    `modules` are the files of the package that draw the figure, such as `figures/arm.py`.
    """
    return _add(name, title, page, of_numbers=True, modules=modules)


def example(name: str, script: Path) -> None:
    """Register the figure of an example. Its title is the first line of the example's docstring."""
    source = script.read_text(encoding="utf-8")
    # Such as `armlet.figures.time_path` and `from armlet.demo import pictures`.
    used = {found.replace(" import ", ".") for found in re.findall(r"armlet\.((?:figures|demo)(?:\.| import )[a-z]\w*)", source)}
    for call, modules in PLOTS.items():
        if f"{call}.plot(" in source:
            used |= modules
    inputs = (script.relative_to(ROOT).as_posix(), *(f"python/armlet/{module.replace('.', '/')}.py" for module in sorted(used)))
    PICTURES[name] = Picture(name, source.split('"""')[1].splitlines()[0], inputs)


def hashes(path: Path = HASHES) -> dict[str, dict[str, str]]:
    """The stored hashes of all pictures."""
    return tomllib.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def file_hash(path: Path) -> str:
    """The hash of a file of the repository."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def stale(stored: dict[str, dict[str, str]] | None = None) -> list[str]:
    """The pictures whose sources have changed, whose files are missing or were changed by hand, and files without a picture."""
    stored = hashes() if stored is None else stored
    faults = [f"{name}: no picture has this name" for name in stored if name not in PICTURES]
    for name, picture in PICTURES.items():
        if not picture.file.exists() or name not in stored:
            faults.append(f"{name}: not drawn")
        elif stored[name]["sources"] != picture.hash():
            faults.append(f"{name}: its sources have changed")
        elif stored[name]["file"] != file_hash(picture.file):
            faults.append(f"{name}: the file was not drawn from its sources")
    return faults
