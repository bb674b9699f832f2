"""Figures in a notebook. matplotlib loads its backend at the first figure, and the backend of notebooks then changes matplotlib's settings.

`matplotlib.rc_context` resets such a change. Then the notebook shows no later figure. This file replaces that backend by one that makes the
same change, because a test has no notebook.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import test_figures

import armlet

BACKEND = """
import matplotlib
from matplotlib.backends.backend_agg import FigureCanvasAgg as FigureCanvas
matplotlib.rcParams["interactive"] = True
"""

PROGRAM = """
import sys
import matplotlib
from matplotlib import pyplot
from test_figures import DRAWN

for name, (_, draw) in DRAWN.items():
    # matplotlib has chosen no backend yet, as at the first figure of a notebook.
    pyplot.close("all")
    pyplot._backend_mod = None
    sys.modules.pop("notebook_backend", None)
    matplotlib.rcParams["interactive"] = False
    matplotlib.rcParams["backend"] = "module://notebook_backend"
    style = dict(matplotlib.rcParams)
    draw(None)
    assert "notebook_backend" in sys.modules, name
    changed = {key for key, value in matplotlib.rcParams.items() if value != style[key]}
    print(name, *sorted(changed))
"""


@pytest.mark.slow
def test_the_first_figure_keeps_the_settings_of_the_notebook(tmp_path: Path) -> None:
    Path(tmp_path, "notebook_backend.py").write_text(BACKEND)
    tests = [str(folder) for folder in Path(__file__).parents[:2]]
    code = f"import sys; sys.path[:0] = {[str(tmp_path), *tests]!r}\n" + PROGRAM
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [f"{name} interactive" for name in test_figures.DRAWN]


def test_all_figures_use_one_style_context() -> None:
    """The test above is sufficient only if no other function of the package changes settings of matplotlib temporarily."""
    package = Path(armlet.__file__).parent
    assert [path.name for path in sorted(package.rglob("*.py")) if "rc_context(" in path.read_text()] == ["style.py"]
