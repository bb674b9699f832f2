"""All thirteen errata of the printed exam have a row in `armlet demo` and a section in docs/exam.md whose code runs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ERRATA = [f"E{i}" for i in range(1, 14)]


def rows(sources: str) -> set[str]:
    """The errata that the checks of the demonstration name."""
    return set(re.findall(r'"(E\d+)"', sources))


def sections(page: str) -> set[str]:
    """The errata that the headings of a page name, where code follows before the next heading."""
    parts = re.split(r"^#+ (.*)$", page, flags=re.MULTILINE)
    return {
        name for title, text in zip(parts[1::2], parts[2::2], strict=True) if "```python" in text for name in re.findall(r"E\d+", title)
    }


@pytest.mark.parametrize("erratum", ERRATA)
def test_every_erratum_has_a_row_and_a_run(erratum: str) -> None:
    demo = "".join(path.read_text() for path in sorted((ROOT / "python/armlet/demo").glob("*.py")))
    page = (ROOT / "docs/exam.md").read_text()
    assert erratum in rows(demo) and erratum in sections(page)
    assert re.search(rf"^\| \[{erratum}\]\(#", page, re.MULTILINE)


def test_what_is_missing_is_seen() -> None:
    assert rows('report.near("x", 1.0, y, 0.0, "printed", "E7")') == {"E7"}
    page = "# Exam\n\n### E1: column\n\n```python\nassert True\n```\n\n### E2, E3: words\n\nNo code.\n"
    assert sections(page) == {"E1"}
