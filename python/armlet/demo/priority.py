"""System 2: two tasks in priority on the macro-micro planar 4R arm, and its singularities.

    v = J1# v1 + (J2 P1)# (v2 - J2 J1# v1),   P1 = I - J1# J1                                                    (5)

The links are L, L, L/4, L/4. The primary task moves the tip of link 4 with the Jacobian J1 and the velocity v1, the secondary the tip of
link 2. J_E has the rows of J1 and J2, and det J_E = L^4/16 sin q2 sin q4. `#` is the pseudo-inverse. (5) is the number of the equation in
the exam. Numbers such as E1 are errata of the exam (docs/exam.md).
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

import armlet as al

from . import rotated

if TYPE_CHECKING:
    from .report import Report

TITLE = "System 2: task priority of the planar 4R arm, at its singularities"

Array: TypeAlias = NDArray[np.float64]

LINKS = (1.0, 1.0, 0.25, 0.25)
CASE_A = np.array([0.0, np.pi / 2, np.pi / 2, 0.0])
CASE_B = np.array([0.0, 0.0, np.pi / 2, 0.0])
ONES = (np.ones(2), np.ones(2))
# |v| is about 2, and the smallest non-zero singular value about 0.5. So the tolerance is about twenty times the rounding error 1e-16
# |v|/sigma.
TOLERANCE = 1e-14

# For each class: its name, whether each of sin q2, sin q3, sin q4 is nonzero (None: either), its kind, and the ranks of J1, J2, J_E, J2 P1.
CLASSES = (
    ("any s3", (True, None, True), "regular", (2, 2, 4, 2)),
    ("any s3, case a", (True, None, False), "algorithmic", (2, 2, 3, 1)),
    ("any s3", (False, None, True), "kinematic", (2, 1, 3, 1)),
    ("case b", (False, True, False), "algorithmic+kinematic", (2, 1, 2, 0)),
    ("degenerate", (False, False, False), "kinematic", (1, 1, 2, 1)),
)


def joints(q: ArrayLike) -> Array:
    """Positions of base, elbows and tip, (5, 2), m."""
    angles = np.cumsum(np.asarray(q, dtype=np.float64))
    steps = np.array(LINKS)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])


def stack(q: ArrayLike) -> list[Array]:
    """J1 (tip of link 4) and J2 (tip of link 2), (2, 4) each. Column j is the vector from joint j to the tip, rotated by 90 degrees."""
    points = joints(q)
    blocks = []
    for tip in (4, 2):
        arms = points[tip] - points[:4]
        arms[tip:] = 0.0
        blocks.append(np.stack([-arms[:, 1], arms[:, 0]]))
    return blocks


def rounding(q: ArrayLike) -> float:
    """Relative rounding error of Jacobian entries that are computed from joint angles."""
    return float(8 * np.finfo(np.float64).eps * (1 + np.abs(q).sum()))


def exact(q: ArrayLike, velocities: Any = ONES) -> al.PrioritySolution:
    return al.solve_priority(stack(q), velocities, method="exact", rounding=rounding(q))


def run(report: Report) -> None:
    solutions(report)
    rotated.run(report)
    wrong_column(report)
    compatibility(report)
    imposed(report)
    trap(report)
    near(report)
    classification(report)
    report.draw_figure("priority", draw)


def solutions(report: Report) -> None:
    a, b = exact(CASE_A), exact(CASE_B)
    report.near("case a, q = (0, pi/2, pi/2, 0): v (rad/s)", (1.0, -2.0, 0.8, 0.4), a.v, TOLERANCE)
    report.near("case b, q = (0, 0, pi/2, 0): v (rad/s)", np.array([22, -15, -52, -26]) / 29, b.v, TOLERANCE)
    J1, J2 = stack(CASE_B)
    realised = np.hstack([J1 @ b.v, J2 @ b.v])
    report.near("case b: velocities realised, primary and secondary (m/s)", (1.0, 1.0, 0.0, 1.0), realised, TOLERANCE)
    # The angle of 20 revolutions has an absolute rounding error about 130 times larger than that of an angle of 1 rad.
    spun = CASE_B + np.array([40 * np.pi + 0.3, 0.0, 0.0, 0.0])
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    report.near("case b, q1 larger by 20 turns and 0.3 rad: v (rad/s)", b.v, exact(spun, [turn @ ONES[0], turn @ ONES[1]]).v, 1e-12)


def wrong_column(report: Report) -> None:
    """Erratum E1: the exam prints L/4 (-s123, c123 + c1234) as the last column of J1. The correct column is L/4 (-s1234, c1234)."""

    def printed(q: Array) -> list[Array]:
        J1, J2 = (J.copy() for J in stack(q))
        angles = np.cumsum(q)
        J1[:, 3] = LINKS[3] * np.array([-np.sin(angles[2]), np.cos(angles[2]) + np.cos(angles[3])])
        return [J1, J2]

    wrong_a = al.solve_priority(printed(CASE_A), ONES, method="exact").v
    wrong_b = al.solve_priority(printed(CASE_B), ONES, method="exact").v
    text = "L/4 (-s123, c123 + c1234)"
    report.near("case a: last column of J1 (m)", (0.0, -0.25), stack(CASE_A)[0][:, 3], TOLERANCE, text, "E1")
    error = np.linalg.norm(stack(CASE_A)[0] @ wrong_a - ONES[0])
    report.equal("case a with the printed column in J1: v has an error in the primary task", True, bool(error > 0.05), text, "E1")
    report.near("case b with the printed column in J1: v does not change", exact(CASE_B).v, wrong_b, TOLERANCE, text, "E1")


def compatibility(report: Report) -> None:
    """Erratum E3: in case a both tasks are exact if and only if n.(p1 - p2) = 0, with n = (c123, s123).

    p1 and p2 are the commanded velocities of the tips. If the condition is false, the secondary task has the error n n'(p2 - p1).
    """
    n = np.array([np.cos(np.pi), np.sin(np.pi)])
    text = "both tasks exact because rank J2 = 2"
    for v2, compatible in ((ONES[1], True), (np.array([1.0, 3.0]), True), (np.zeros(2), False)):
        shown = f"p2 = ({v2[0]:g}, {v2[1]:g}) m/s"
        seen = al.diagnose_priority(stack(CASE_A), rhs=[ONES[0], v2], rounding=rounding(CASE_A))
        report.equal(f"case a, p1 = (1, 1), {shown}: both exact, by the diagnosis", compatible, bool(seen.compatible), text, "E3")
        residual = exact(CASE_A, [ONES[0], v2]).residuals[1]
        report.near(f"case a, {shown}: secondary residual = n n'(p2 - p1)", n * (n @ (v2 - ONES[0])), residual, TOLERANCE, text, "E3")


def imposed(report: Report) -> None:
    """Erratum E4: in case b J2 P1 = 0. So the primary task determines the velocity of the secondary tip, for every command."""
    seen = al.diagnose_priority(stack(CASE_B), rounding=rounding(CASE_B))
    text = "only the x of the secondary task is lost"
    report.bound("case b: largest singular value of J2 P1", seen.projected_singular_values[1].max(), 1e-15)
    report.equal("case b: rank of J2 P1", 0, seen.projected_ranks[1], text, "E4")
    pair = [exact(CASE_B, [ONES[0], v2]).v for v2 in (np.array([1.0, 1.0]), np.array([-5.0, 7.0]))]
    report.near("case b: v for p2 = (-5, 7) equals v for p2 = (1, 1)", pair[0], pair[1], TOLERANCE, text, "E4")


def trap(report: Report) -> None:
    """Check a pitfall: numpy's pinv neglects only singular values that are small relative to the largest one.

    In case b the exact J2 P1 is zero, and the computed one consists of rounding errors. pinv inverts these errors.
    """
    q = CASE_B + np.array([0.3, 0.0, 0.0, 0.0])
    J1, J2 = stack(q)
    inverse = np.linalg.pinv(J1)
    projected = J2 @ (np.eye(4) - inverse @ J1)
    v = inverse @ ONES[0] + np.linalg.pinv(projected) @ (ONES[1] - J2 @ inverse @ ONES[0])
    mine = exact(q)
    size, missed = np.linalg.norm(v), np.abs(ONES[0] - J1 @ v).max()
    what = f"case b turned by 0.3 rad, numpy's pinv: |v| = {size:.1e} rad/s, primary missed by {missed:.1e} m/s"
    report.equal(what, True, bool(missed > 0.1))
    report.bound("case b turned by 0.3 rad, armlet: primary residual (m/s)", np.abs(mine.residuals[0]).max(), TOLERANCE)
    report.near("case b turned by 0.3 rad, armlet: v = J1# p1, because J2 P1 = 0 (rad/s)", inverse @ ONES[0], mine.v, TOLERANCE)


def near(report: Report) -> None:
    """Check the velocities near the algorithmic singularity of case a, at q4 = 1e-12.

    The method "exact" of `al.solve_priority` returns very large velocities. The default method "clamp" returns velocities near the exact
    ones at q4 = 0, and the primary task is exact.
    """
    q = CASE_A + np.array([0.0, 0.0, 0.0, 1e-12])
    velocities = [ONES[0], np.zeros(2)]
    wild = np.linalg.norm(exact(q, velocities).v)
    report.equal(f"case a at q4 = 1e-12, p2 = 0, exact: |v| = {wild:.0e} rad/s", True, bool(wild > 1e10))
    clamped = al.solve_priority(stack(q), velocities, eps=[0.05, 0.02])
    report.near("case a at q4 = 1e-12, p2 = 0, clamp: v (rad/s) equals v at q4 = 0", exact(CASE_A, velocities).v, clamped.v, 1e-8)
    report.bound("case a at q4 = 1e-12, p2 = 0, clamp: primary residual (m/s)", np.abs(clamped.residuals[0]).max(), TOLERANCE)


def classification(report: Report) -> None:
    """Check the classification of 27 patterns: each of the joints 2, 3, 4 is stretched (0), folded (pi), or at a third angle."""
    turns = (None, 0.0, np.pi)
    found: dict[int, list[tuple[str, tuple[int, ...]]]] = {i: [] for i in range(len(CLASSES))}
    for pattern in product(turns, repeat=3):
        q = np.array([0.4, *(free if turn is None else turn for free, turn in zip((0.7, -1.3, 2.1), pattern, strict=True))])
        moved = [turn is None for turn in pattern]
        (index,) = [i for i, (_, sines, *_) in enumerate(CLASSES) if all(s in (None, m) for s, m in zip(sines, moved, strict=True))]
        seen = al.diagnose_priority(stack(q), rounding=rounding(q))
        found[index].append((seen.kind, (*seen.ranks, seen.stacked_rank, seen.projected_ranks[1])))
    for index, (name, sines, kind, ranks) in enumerate(CLASSES):
        signs = ", ".join(f"s{i + 2} {'not 0' if s else '0'}" for i, s in enumerate(sines) if s is not None)
        what = f"{signs} ({name}): kind, ranks of J1, J2, J_E, J2 P1 in {len(found[index])} patterns"
        answers = {f"{each_kind} {each_ranks}" for each_kind, each_ranks in found[index]}
        report.equal(what, f"{kind} {ranks}", " | ".join(sorted(answers)))
    report.equal("patterns classified", 27, sum(map(len, found.values())))


def draw(figure: Any) -> None:
    """Draw the arm in cases a and b, with commanded and realised velocities, as in the figure of the exam."""
    from ..figures.style import COLOURS

    figure.set_size_inches(11.5, 5.0)
    figure.set_layout_engine("constrained")
    heading = "Task priority: the tip of link 4 (task 1, square) before the tip of link 2 (task 2)"
    figure.suptitle(f"{heading}. Arrows: displacement in 0.8 s", fontsize=10)
    cases = (("Case a", CASE_A, "lower right"), ("Case b", CASE_B, "upper left"))
    for ax, (name, q, corner) in zip(figure.subplots(1, 2), cases, strict=True):
        points, sol = joints(q), exact(q)
        seen = al.diagnose_priority(stack(q), rounding=rounding(q))
        ax.plot(*points.T, color="0.25", linewidth=4, solid_capstyle="round", zorder=2)
        ax.plot(*points[:-1].T, "o", color="white", markeredgecolor="0.25", markersize=8, markeredgewidth=1.5, zorder=3)
        ax.plot(*points[-1], "s", color="0.25", markersize=6, zorder=3)
        for level, (tip, label) in enumerate(((4, "task 1"), (2, "task 2"))):
            target_velocity, realised = ONES[level], stack(q)[level] @ sol.v
            # The commanded velocity is a wide pale arrow. So the realised velocity is visible on it where both agree.
            for velocity, width, alpha, order, text in (
                (target_velocity, 0.022, 0.35, 4, f"{label} commanded: ({target_velocity[0]:.0f}, {target_velocity[1]:.0f}) m/s"),
                (realised, 0.008, 1.0, 5, f"{label} realised: ({realised[0]:z.0f}, {realised[1]:z.0f}) m/s"),
            ):
                ax.quiver(
                    *points[tip], *(0.8 * velocity), angles="xy", scale_units="xy", scale=1.0,
                    width=width, color=COLOURS[level], alpha=alpha, zorder=order, label=text,
                )  # fmt: skip
        result = "both velocities are realised" if np.allclose(sol.residuals[1], 0.0) else "task 2 is realised in part"
        rates = ", ".join(f"{x:.3g}" for x in sol.v)
        ax.set_title(
            f"{name}: {seen.kind.replace('+', ' and ')} singularity, {result}\njoint velocities ({rates}) rad/s", loc="left", fontsize=9
        )
        ax.set_aspect("equal")
        ax.set_xlim(-0.3, 3.1)
        ax.set_ylim(-0.25, 1.95)
        ax.set_xlabel("x (m)")
        ax.set_ylabel("y (m)")
        ax.grid(alpha=0.3, linewidth=0.6)
        ax.spines[["top", "right"]].set_visible(False)
        ax.legend(loc=corner, fontsize=8, framealpha=0.9, edgecolor="none")
