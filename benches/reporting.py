"""Output of all benchmarks: the machine, the targets with the measured figures, and the table; printed or written into README.md."""

from __future__ import annotations

import argparse
from pathlib import Path

import timing
from timing import Case

import armlet as al

HERE = Path(__file__).parent
# Name of the target, goal, measured figure, and whether the figure meets the goal.
Verdict = tuple[str, str, str, bool]


def arguments(description: str) -> argparse.ArgumentParser:
    """The command-line options of every benchmark."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--markdown", action="store_true", help="print Markdown")
    parser.add_argument("--readme", action="store_true", help="put the figures into benches/README.md")
    parser.add_argument("--rounds", type=int, default=21)
    parser.add_argument("--core", type=int, default=timing.cores()[-1], help="core of the single-thread cases (default: the last allowed)")
    return parser


def require_release(name: str) -> None:
    if al.build_info()["profile"] != "release":
        raise SystemExit(f"{name}: armlet is a debug build: install the release wheel (make bench)")


def heading(cases: list[Case], busy: float) -> str:
    """One line with the machine, the build and the number of rounds."""
    machine, info = timing.machine(), al.build_info()
    rounds = max(len(case.wall) for case in cases)
    return (
        f"{machine['cpu']}, {machine['cores']} cores, {machine['simd']}; other programs used {busy:.0%} of them at the start. "
        f"armlet {info['version']}, {info['profile']} build. Medians of up to {rounds} interleaved rounds."
    )


def target_table(verdicts: list[Verdict]) -> list[str]:
    """The targets as a table in Markdown."""
    table = ["| target | goal | measured | |", "|---|---:|---:|---|"]
    return table + [f"| {what} | {goal} | {got} | {'met' if met else '**missed**'} |" for what, goal, got, met in verdicts]


def report(cases: list[Case], verdicts: list[Verdict], busy: float, as_markdown: bool, more: tuple[str, ...] = ()) -> str:
    """The figures as text or Markdown. `more` are lines of Markdown between the targets and the table."""
    head, lines = heading(cases, busy), timing.rows(cases)
    if not as_markdown:
        text = [head, timing.plain(lines), "", "Targets"]
        return "\n".join(text + [f"  {'met   ' if met else 'MISSED'} {what}: {got} (target {goal})" for what, goal, got, met in verdicts])
    between = [*target_table(verdicts), ""] if verdicts else []
    between += [*more, ""] if more else []
    return "\n".join([head, "", *between, timing.markdown(lines)])


def finish(section: str, text: str, into_readme: bool) -> None:
    """Print the figures. If `into_readme`, write them between the marks of `section` in README.md."""
    if into_readme:
        write_figures(section, text)
    print(text)


def write_figures(section: str, text: str) -> None:
    """Write the figures between the marks of `section` in README.md."""
    path, marks = HERE / "README.md", (f"<!-- {section}: begin -->", f"<!-- {section}: end -->")
    before, rest = path.read_text().split(marks[0])
    path.write_text(f"{before}{marks[0]}\n{text}\n{marks[1]}{rest.split(marks[1])[1]}")
