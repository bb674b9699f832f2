"""ratio = time of armlet / time of generated straight-line C, for the control laws of `control_cases.py`. Equal results are asserted first.

`bench_generated_c.py` describes how the C is generated and timed. Here the C also has the comparisons and square roots of these laws.
Two options are compared with armlet's loop without the option: stick-slip friction, and reactions to contact.

    python -P benches/bench_control_laws.py                     every law
    python -P benches/bench_control_laws.py --laws composite    one law
    python -P benches/bench_control_laws.py --readme            the table, written into benches/README.md
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))  # `python -P` does not add this folder

import bench_generated_c as generated
import casadi
import control_cases
import reporting
import timing
from generated_cases import BATCHES, CHECKED, H, Row, loop_row, require_equal

import armlet as al

# The two arms of each law. Composite adaptation runs on smaller arms, because the number of its filters grows with the square of the number
# of joints.
ARMS = {law: ("planar 2R", "planar 4R") if law == "composite" else ("planar 4R", "seven axes") for law in control_cases.CONTROL}
GOAL = generated.BATCH
BESIDE = 1000  # number of steps of the loops with an option, and of those without it


def beside(name: str, steps: int) -> list[tuple[str, str, timing.Case, timing.Case]]:
    """Rows (arm, option, one run with the option, one run without it). Equal results are asserted first."""
    laws, found = control_cases.ControlLaws(generated.ARMS[name](), steps), []
    for option, (with_it, without, more) in control_cases.beside(laws.arm, laws.motion).items():
        given: dict[str, Any] = {"q0": laws.rest, "dt": H, "monitors": False, "throw": True, **more}

        def run(loop: tuple[Any, Any], count: int, given: dict[str, Any] = given) -> Any:
            return al.simulate(*loop, **given, t_end=count * H, record_every=count)

        ours, theirs = (run(loop, CHECKED).q[-1] for loop in (with_it, without))
        require_equal(f"{name}, {option}", ours, theirs)
        pair = (
            timing.Case("beside", f"{word}, {name}, {option}", partial(run, loop, steps), steps)
            for word, loop in zip(("with", "without"), (with_it, without), strict=True)
        )
        found.append((name, option, *pair))
    return found


def verdicts(rows: list[Row]) -> list[reporting.Verdict]:
    found = generated.verdict("one run", generated.ONE, [(row.pairs["one run"].ratio, row) for row in rows])
    for runs in BATCHES:
        name = f"batch of {runs:,}"
        found += generated.verdict(name, GOAL, [(row.pairs[name].ratio, row) for row in rows])
    return found


def main() -> None:
    parser = reporting.arguments("armlet's laws of control beside generated straight-line C")
    parser.add_argument("--laws", nargs="*", default=list(control_cases.CONTROL), help=", ".join(control_cases.CONTROL))
    options = parser.parse_args()
    reporting.require_release("bench_control_laws")
    share, rows = timing.busy(), []
    for law in options.laws:
        for name in ARMS[law]:
            generated.say(f"{name}, {law}")
            arm = generated.ARMS[name]()
            steps = generated.steps_of(arm) if law != "composite" else 1000
            rows.append(loop_row(name, control_cases.ControlLaws(arm, steps), law, steps))
    options_of = [found for name in ("planar 4R", "seven axes") for found in beside(name, BESIDE)]
    cases = [case for row in rows for pair in row.pairs.values() for case in (pair.ours, pair.theirs)]
    cases += [case for _, _, *pair in options_of for case in pair]
    timing.measure(cases, options.rounds, options.core, generated.say)
    head = reporting.heading(cases, share) + f" CasADi {casadi.CasadiMeta.version()}, g++ {generated.compiler()}."
    text = [head, "", *reporting.target_table(verdicts(rows)), "", *generated.loop_table(rows)]
    if any(generated.TWO in row.pairs for row in rows):
        text += ["", "**Two threads: ns per run and step**", "", *generated.threads_table(rows)]
    text += ["", "**Loops with and without an option of the plant or law, one run: ns per step**", ""]
    text += ["| arm | option | with it | without it | ratio |", "|---|---|---:|---:|---:|"]
    for name, option, ours, theirs in options_of:
        text.append(f"| {name} | {option} | {ours.median:,.0f} | {theirs.median:,.0f} | {timing.ratio(ours, theirs):.2f} |")
    reporting.finish("control_laws", "\n".join(text), options.readme)


if __name__ == "__main__":
    main()
