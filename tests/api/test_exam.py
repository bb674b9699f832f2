"""Each erratum and sub-question of the printed exam has a row in `armlet demo` and a section with code in docs/exam.md."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ERRATA = [f"E{i}" for i in range(1, 14)]
# For each sub-question: a row of the demonstration, and the section of the page with its code.
QUESTIONS = {
    "the linear parametrisation": ("Y(q, v, v_r, a_r) pi = M a_r + S v_r", "Exercise 1: adaptive tracking"),
    "Christoffel matrices": ("C_1 = [[0, 0], [0, -B sin q2]], C_2 = 0", "Exercise 1: adaptive tracking"),
    "the printed regressor": ("printed Y, entry (", "Exercise 1: adaptive tracking"),
    "the proof of convergence": ("V1(0) - V1(t) - integral of s' Kd s, largest", "Exercise 1: adaptive tracking"),
    "velocities of both cases": ("case b: velocities realised, primary and secondary (m/s)", "Exercise 2: task priority"),
    "the Jacobian of absolute angles": ("columns of J'_E = J_E T^-1", "The rotated frame"),
    "the rotated Jacobian": ("1J'_E = blockdiag(R', R') J'_E", "The rotated frame"),
    "the determinant": ("det J_E, J'_E, 1J'_E = l1 l2 l3 l4 sin q2 sin q4", "The rotated frame"),
    "the target model": ("residual of the target model divided by its largest term", "The rigid arm in Cartesian coordinates"),
    "equation (7)": ("equation (7) with g_x = J^-T g", "The rigid arm in Cartesian coordinates"),
    "the rest under a force": ("x at 12 s = x_E = x_d + K_m^-1 F (m)", "Exercise 3: elastic joints"),
    "the minimum time": ("T_min / sqrt(4 pi I / tau_max) - 1, largest", "Exercise 4: minimum time"),
    "a link by its mass": ("I = I_c + m d^2 (kg m^2)", "Inertia and gravity moment from the mass"),
    "gravity against inertia": ("gravity always opposes the inertial torque", "Where gravity opposes the inertial torque"),
}


def demonstration() -> str:
    """The source text of `armlet demo`."""
    return "".join(path.read_text() for path in sorted((ROOT / "python/armlet/demo").glob("*.py")))


def rows(sources: str) -> set[str]:
    """The errata in the checks of the demonstration."""
    return set(re.findall(r'"(E\d+)"', sources))


def with_code(page: str) -> set[str]:
    """The headings of the sections that contain code."""
    parts = re.split(r"^#+ (.*)$", page, flags=re.MULTILINE)
    return {title for title, text in zip(parts[1::2], parts[2::2], strict=True) if "```python" in text}


def sections(page: str) -> set[str]:
    """The errata in the headings of the sections that contain code."""
    return {name for title in with_code(page) for name in re.findall(r"E\d+", title)}


@pytest.mark.parametrize("erratum", ERRATA)
def test_every_erratum_has_a_row_and_a_run(erratum: str) -> None:
    page = (ROOT / "docs/exam.md").read_text()
    assert erratum in rows(demonstration()) and erratum in sections(page)
    assert re.search(rf"^\| \[{erratum}\]\(#", page, re.MULTILINE)


@pytest.mark.parametrize("question", QUESTIONS)
def test_every_sub_question_has_a_row_and_a_run(question: str) -> None:
    row, section = QUESTIONS[question]
    assert row in demonstration() and section in with_code((ROOT / "docs/exam.md").read_text())


def test_a_missing_erratum_is_detected() -> None:
    assert rows('report.near("x", 1.0, y, 0.0, "printed", "E7")') == {"E7"}
    # A page whose sections E2 and E3 have no code: the check must not accept them.
    page = "# Exam\n\n### E1: column\n\n```python\nassert True\n```\n\n### E2, E3: words\n\nNo code.\n"
    assert sections(page) == {"E1"}
