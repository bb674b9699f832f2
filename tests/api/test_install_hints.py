"""No text recommends an installation of armlet from a package index. The name is not registered there, so a stranger could publish it."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PLACES = (
    "README.md",
    "CONTRIBUTING.md",
    "RELEASING.md",
    "SECURITY.md",
    "CHANGELOG.md",
    "docs",
    "examples",
    "python",
    "rust",
    "tools",
    "benches",
)
ENDINGS = {".md", ".py", ".pyi", ".rs", ".ipynb", ".toml", ".rst", ".sh", ".html", ".txt"}
#: A command that installs `armlet`, and the argument `armlet[extra]` of such a command. A path such as `dist/armlet-0.1.0.whl` is allowed.
COMMAND = re.compile(r"\b(?:install|add|uvx|pipx run)\b[^\n.;`]*?(?<![\w/.*-])armlet(?:==[\w.]+)?(?=[\s'\"`)\\]|$)")
EXTRA = re.compile(r"(?<![\w/.*-])armlet\[[a-z, ]+\]")


def from_index(text: str) -> list[str]:
    """The lines that recommend an installation of armlet from an index."""
    lines = [line for line in text.splitlines() if EXTRA.search(line) or COMMAND.search(line)]
    return [line for line in lines if "--no-index" not in line]


def sources() -> list[Path]:
    found = [path for place in PLACES for path in ([ROOT / place] if (ROOT / place).is_file() else (ROOT / place).rglob("*"))]
    return [path for path in found if path.suffix in ENDINGS]


def test_no_text_installs_armlet_from_an_index() -> None:
    files = sources()
    assert len(files) > 500
    assert {str(path.relative_to(ROOT)): found for path in files if (found := from_index(path.read_text()))} == {}


@pytest.mark.parametrize(
    "text", ["pip install armlet", "pip install 'armlet[plot]'", 'uv add "armlet"', "pip install -U armlet==0.1.0", "armlet[live]"]
)
def test_a_recommendation_is_detected(text: str) -> None:
    assert from_index(f"first\nuse `{text}`\n") == [f"use `{text}`"]


@pytest.mark.parametrize(
    "text", ["pip install '.[plot]'", 'pip install "$(ls build/dist/armlet-*.whl)[live]"', "pip install --no-index armlet"]
)
def test_an_installation_from_files_is_allowed(text: str) -> None:
    assert from_index(text) == []


def test_hints_name_existing_extras() -> None:
    """The advice on a missing library names an extra of pyproject.toml that installs a package."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    named = set()
    for path in (ROOT / "python").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("extra", "missing"):
                named |= {argument.value for argument in node.args[2:3] if isinstance(argument, ast.Constant)}
    texts = "".join(path.read_text() for path in sources())
    written = {name for names in re.findall(r"'\.\[([a-z,]+)\]'", texts) for name in names.split(",")}
    assert {"plot", "live", "gym", "tune"} <= named and "plot" in written
    assert (named | written) - set(extras) == set()
