"""The reference imports numpy only. If it imported compiled code of armlet, parity tests would compare this code with itself."""

import ast
import sys
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "python" / "armlet" / "reference"


def foreign(source: str) -> list[str]:
    """Return the modules that a source imports, except numpy, the standard library and its own package."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            found.append("." * node.level + (node.module or ""))
    allowed = {"numpy", *sys.stdlib_module_names}
    return [name for name in found if name.split(".")[0] not in allowed and (not name.startswith(".") or name.startswith(".."))]


def test_only_numpy_is_imported() -> None:
    files = sorted(FOLDER.glob("*.py"))
    assert len(files) >= 10
    assert {path.name: foreign(path.read_text()) for path in files} == {path.name: [] for path in files}


def test_the_check_sees_what_it_must() -> None:
    assert foreign("import scipy.linalg") and foreign("from armlet._core import x") and foreign("from .. import _core")
    assert not foreign("from . import law") and not foreign("import re\nimport numpy as np\nfrom .arm import Arm")


def test_files_stay_small_and_open_with_words() -> None:
    for path in FOLDER.glob("*.py"):
        text = path.read_text()
        assert text.count("\n") <= 300, path.name
        assert ast.get_docstring(ast.parse(text)), path.name
