"""Error against time on standard test problems, for armlet, scipy, numbalsoda and diffrax: a figure and a table.

    python -P benches/work_precision.py              # the table
    python -P benches/work_precision.py --readme     # the figure into docs/images, the table into benches/README.md

numbalsoda and diffrax compile the right-hand side. armlet and scipy call a Python function, which takes most of their time.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from bench_integrate import PROBLEMS, TOLERANCES, measure, write

FIGURE = Path(__file__).resolve().parents[1] / "docs" / "images" / "work_precision.png"
BEGIN, END = "<!-- work: begin -->", "<!-- work: end -->"
#: Colour and marker of every case. A dashed line marks a compiled right-hand side.
STYLES = {
    "armlet dop853, lists": ("#0072B2", "o-", "armlet dop853"),
    "armlet dopri5, lists": ("#56B4E9", "o-", "armlet dopri5"),
    "armlet radau5, lists": ("#0072B2", "s-", "armlet radau5"),
    "armlet rodas4, lists": ("#56B4E9", "s-", "armlet rodas4"),
    "scipy DOP853": ("#D55E00", "^-", "scipy DOP853"),
    "scipy RK45": ("#E69F00", "^-", "scipy RK45"),
    "scipy Radau": ("#D55E00", "v-", "scipy Radau"),
    "scipy LSODA": ("#CC79A7", "v-", "scipy LSODA"),
    "diffrax, compiled f": ("#009E73", "D--", "diffrax Dopri8, Kvaerno5 (compiled)"),
    "numbalsoda, compiled f": ("#000000", "x--", "numbalsoda (compiled)"),
}
Row = tuple[str, float, str, float, float]


def table(rows: list[Row]) -> str:
    """One row per problem and case: milliseconds and error at each tolerance."""
    lines = ["| problem | case | " + " | ".join(f"{tol:.0e}: ms, error" for tol in TOLERANCES) + " |"]
    lines.append("|---|---|" + "---:|" * len(TOLERANCES))
    found = {(problem, name, tol): f"{1e3 * seconds:.3g}, {error:.1e}" for problem, tol, name, seconds, error in rows}
    for problem in PROBLEMS:
        for name, (_, _, label) in STYLES.items():
            cells = [found.get((problem, name, tol), "") for tol in TOLERANCES]
            if any(cells):
                lines.append(f"| {problem} | {label} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def draw(rows: list[Row], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 6.6), layout="constrained")
    panels = figure.subplots(2, 3)
    drawn = {}
    for axes, problem in zip(panels.flat, PROBLEMS, strict=True):
        for name, (colour, style, label) in STYLES.items():
            points = sorted((row[4], 1e3 * row[3]) for row in rows if row[0] == problem and row[2] == name)
            if points:
                (drawn[label],) = axes.loglog(*zip(*points, strict=True), style, color=colour, markersize=4, linewidth=1.2)
        axes.set(xlabel="error at the end (relative)", ylabel="processor time (ms)")
        axes.set_title(problem, loc="left", fontsize=10)
        axes.invert_xaxis()
        axes.grid(alpha=0.3, linewidth=0.6)
    figure.legend(drawn.values(), drawn.keys(), loc="outside lower center", ncols=5, fontsize=8)
    figure.savefig(path, dpi=130)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--readme", action="store_true", help="write the figure and the table")
    arguments = parser.parse_args()
    rows = measure(arguments.rounds, STYLES.__contains__)
    text = table(rows)
    print(text)
    if arguments.readme:
        draw(rows, FIGURE)
        write(text, BEGIN, END)
    return 0


if __name__ == "__main__":
    sys.exit(main())
