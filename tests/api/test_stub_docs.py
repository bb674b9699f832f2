"""The stubs of the extension have its docstrings, so that editors show them. `python tools/stub_docs.py` writes them."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from scripts import imported

import armlet as al
from armlet import _core

ROOT = Path(__file__).resolve().parents[2]


STUB_DOCS = imported(ROOT / "tools" / "stub_docs.py")
TREES = [ast.parse(path.read_text()) for path in sorted((ROOT / "python/armlet/_core").glob("*.pyi"))]
STUBS = {node.name: node for tree in TREES for node in tree.body if isinstance(node, ast.ClassDef | ast.FunctionDef)}


def test_the_stubs_are_fresh() -> None:
    """If this fails, a docstring or a stub has changed: run `python tools/stub_docs.py` with the built extension."""
    assert [path.name for path in STUB_DOCS.stale(_core)] == []


def test_every_public_name_has_a_docstring_in_its_stub() -> None:
    """With its members. The docstring is that of the extension, so it has shapes, units and the example of `test_docstrings`."""
    public = [name for name in al.__all__ if getattr(al, name) is getattr(_core, name, None) and name != "__version__"]
    assert len(public) > 60
    silent = [name for name in public if ast.get_docstring(STUBS[name]) != inspect.cleandoc(getattr(al, name).__doc__)]
    members = {
        f"{name}.{node.name}": ast.get_docstring(node)
        for name in public
        for node in STUBS[name].body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and not STUB_DOCS.is_setter(node)
    }
    assert len(members) > 150 and not any("builtin" in str(text) for text in members.values())
    assert silent + [name for name, text in members.items() if not text] == []


def test_a_stale_stub_is_detected(tmp_path: Path) -> None:
    source = (ROOT / "python/armlet/_core/plants.pyi").read_text()
    for text in (source, source.replace("The arm of the plant.", "An arm.")):
        (tmp_path / "plants.pyi").write_text(text)
        assert [path.name for path in STUB_DOCS.stale(_core, tmp_path)] == ([] if text == source else ["plants.pyi"])


BARE = '''"""Types."""

class Gains:
    def __new__(cls, kp: float) -> Gains: ...
    @property
    def kp(self) -> float: ...
    @property
    def step(self) -> float: ...
    @step.setter
    def step(self, step: float) -> None: ...
    def scaled(self, by: float) -> Gains: ...  # a copy

def gains() -> Gains: ...
def _hidden() -> None: ...
'''
FULL = '''"""Types."""

class Gains:
    """Gains.

    - `kp`, `kd`: gains, N m/rad.
      Each is a number.
    """

    def __new__(cls, kp: float) -> Gains: ...
    @property
    def kp(self) -> float:
        """Gains, N m/rad. Each is a number."""

    @property
    def step(self) -> float:
        """Step, s."""

    @step.setter
    def step(self, step: float) -> None: ...
    def scaled(self, by: float) -> Gains:
        r"""Scaled gains, \\gamma.

        >>> "x"
        """  # a copy

def gains() -> Gains:
    """Make gains."""

def _hidden() -> None: ...
'''


def described(text: str) -> Any:
    return SimpleNamespace(__doc__=text)


def test_docstrings_are_written_and_replaced() -> None:
    members = {"kp": described(""), "step": described("Step, s."), "scaled": described('Scaled gains, \\gamma.\n\n>>> "x"')}
    kind = type("Gains", (), members | {"__doc__": "Gains.\n\n- `kp`, `kd`: gains, N m/rad.\n  Each is a number."})
    module: Any = SimpleNamespace(Gains=kind, gains=described("Make gains."), _hidden=described("Hidden."))
    written = STUB_DOCS.documented(BARE, module, "a.pyi")
    assert [line for line in written.split("\n") if line] == [line for line in FULL.split("\n") if line]
    assert STUB_DOCS.documented(written, module, "a.pyi") == written
    kind.__doc__ = "Other."
    other = STUB_DOCS.documented(written, module, "a.pyi")
    assert '"""Other."""' in other and "Each is a number" not in other


@pytest.mark.parametrize(
    ("text", "expected"), [("", {}), ("- `a`: one; `b`: two.", {"a": "One."}), ("- `a` and `b`: x, m.", {"a": "X, m.", "b": "X, m."})]
)
def test_fields_of_a_class(text: str, expected: dict[str, str]) -> None:
    assert STUB_DOCS.fields(text) == expected
