"""The notebooks run completely without network, and contain neither outputs nor pictures."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


CLOSED = """
import socket
class Closed(socket.socket):
    def connect(self, *_):
        raise OSError("no network")
socket.socket = Closed
"""


def code(notebook: dict[str, Any]) -> str:
    """The code cells as one program. A comment before each cell names it."""
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return "\n\n".join(f"# {cell['id']}\n{''.join(cell['source'])}" for cell in cells)


def run(source: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the code in a new interpreter, without display and without sockets. Warnings are errors."""
    head = "import matplotlib\nmatplotlib.use('Agg')\n" + CLOSED
    command = [sys.executable, "-P", "-W", "error", "-c", head + source]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)


def faults(notebook: dict[str, Any]) -> list[str]:
    """The faults of a notebook: forbidden content, and missing content."""
    found = [] if (notebook["nbformat"], bool(notebook["cells"])) == (4, True) else ["is no notebook of format 4 with cells"]
    ids = [cell["id"] for cell in notebook["cells"]]
    found += ["has two cells of one id"] if len(set(ids)) < len(ids) else []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code" and (cell["outputs"] or cell["execution_count"] is not None):
            found.append(f"{cell['id']} has outputs")
        if cell["cell_type"] == "code" and any(line.startswith(("%", "!")) for line in cell["source"]):
            found.append(f"{cell['id']} is not plain Python")
    return found


def test_notebooks_of_all_exercises_the_first_steps_a_log_and_priorities_exist() -> None:
    assert [path.stem[:10] for path in NOTEBOOKS] == [*(f"exercise_{i}" for i in (1, 2, 3, 4)), "first_ten_", "log_lie_mo", "priorities"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook(path: Path, tmp_path: Path) -> None:
    notebook = json.loads(path.read_text())
    assert faults(notebook) == []
    assert notebook["cells"][0]["cell_type"] == "markdown"
    result = run(code(notebook) + "\nprint(len(plt.get_fignums()))", tmp_path)
    assert result.returncode == 0, result.stderr
    assert "assert " in code(notebook)
    # A notebook shows the figures of pyplot, and the last expression of a cell, such as a film.
    assert int(result.stdout.splitlines()[-1]) >= 2
    films = [cell for cell in notebook["cells"] if ".animate(" in "".join(cell["source"])]
    assert [path for path in tmp_path.iterdir() if path.suffix == ".gif"] != [] or not films
    assert all(".animate(" in cell["source"][-1] for cell in films)


def test_a_broken_notebook_is_detected(tmp_path: Path) -> None:
    cell = {"cell_type": "code", "id": "a", "execution_count": 1, "outputs": [{}], "source": ["%matplotlib inline\n", "x = 1\n"]}
    assert faults({"nbformat": 4, "cells": [cell, cell]}) == ["has two cells of one id", *["a has outputs", "a is not plain Python"] * 2]
    later = cell | {"source": ["assert x == 2\n"]}
    result = run(code({"cells": [cell | {"source": ["x = 1\n"]}, later]}), tmp_path)
    assert result.returncode == 1 and "AssertionError" in result.stderr
    assert "no network" in run("import urllib.request\nurllib.request.urlopen('http://127.0.0.1:9')", tmp_path).stderr
