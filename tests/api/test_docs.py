"""Every Python block of README and docs/, and every example, runs as printed."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
# Examples that need what `make test` does not install; `make test-peers` runs them where it is.
NEEDS = {"mujoco_loop.py": "mujoco"}
FENCE = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def program(page: str) -> str:
    """The blocks of a page one after the other, each on the line where it stands, so that a traceback names the page's line."""
    text = ""
    for block in FENCE.finditer(page):
        text += "\n" * (page[: block.start(1)].count("\n") - text.count("\n")) + block.group(1)
    return text


def run(source: str, name: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a program in its own interpreter and folder, without a display; warnings are errors."""
    code = f"import matplotlib; matplotlib.use('Agg'); exec(compile({source!r}, {name!r}, 'exec'), {{'__name__': '__main__'}})"
    command = [sys.executable, "-P", "-W", "error", "-c", code]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("page", [page for page in PAGES if "```python" in page.read_text()], ids=name_of)
def test_page(page: Path, tmp_path: Path) -> None:
    source = program(page.read_text())
    assert source.strip()
    result = run(source, name_of(page), tmp_path)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("example", EXAMPLES, ids=name_of)
def test_example(example: Path, tmp_path: Path) -> None:
    result = run(example.read_text(), name_of(example), tmp_path)
    needed = NEEDS.get(example.name)
    if needed is not None and find_spec(needed) is None:
        # It says so in one line.
        assert result.returncode == 1
        assert result.stderr == f"{example.stem}: {needed} is not installed: pip install 'armlet[{needed}]'\n"
        return
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip()


def test_there_is_something_to_run() -> None:
    assert [page.name for page in PAGES if "```python" in page.read_text()] and EXAMPLES


def test_a_broken_block_is_seen(tmp_path: Path) -> None:
    page = "# Title\n\n```python\nx = 1\n```\n\ntext\n\n```python\nassert x == 2\n```\n"
    result = run(program(page), "page.md", tmp_path)
    assert result.returncode != 0
    assert '"page.md", line 10' in result.stderr


def test_links_lead_somewhere() -> None:
    """Relative links of the pages name files that exist."""
    broken = []
    for page in [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]:
        for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text()):
            if "://" not in target and not (page.parent / target).exists():
                broken.append(f"{name_of(page)}: {target}")
    assert broken == []


def test_code_paths_exist() -> None:
    """Files of the repository that a page names in code font exist."""
    missing = []
    for page in PAGES:
        for target in re.findall(r"`((?:rust|python|examples|tests|docs|tools)/[\w./-]+)`", page.read_text()):
            if not (ROOT / target).exists():
                missing.append(f"{name_of(page)}: {target}")
    assert missing == []
