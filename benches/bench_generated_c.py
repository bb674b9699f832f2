"""ratio = time of armlet / time of generated straight-line C, for closed loops and functions of arms. Equal results are asserted first.

CasADi generates the C of each loop and function. g++ compiles it twice: for one row at a time, and for lanes of rows. A lane is one
element of a SIMD register; a register has 8 lanes with AVX-512 and 4 with AVX2. ARMLET_LIMITS=DIR adds two loops whose C was written by
hand (`hand_written.py`).

    python -P benches/bench_generated_c.py                      every arm
    python -P benches/bench_generated_c.py --arms arm.urdf      an arm from a file, a chain or a tree on a fixed base
    python -P benches/bench_generated_c.py --readme             the tables, written into benches/README.md
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("ARMLET_NUM_THREADS", "1")  # batches of functions read their number of threads from this variable
sys.path.insert(0, str(Path(__file__).parent))  # `python -P` does not add this folder

try:
    import casadi
except ImportError:
    raise SystemExit("bench_generated_c: casadi is not installed: pip install -r requirements/bench.txt") from None
import hand_written
import reporting
import timing
from generated_cases import BATCHES, LAWS, ROWS, SHORT, TWO, Laws, Pair, Row, alone, function_row, functions, gains, loop_row, numpy_call
from generated_tree import branched, made
from timing import Case

import armlet as al

ARMS: dict[str, Callable[[], al.Arm]] = {
    "planar 2R": lambda: al.planar_arm([0.5, 0.4], masses=[3.0, 2.0]),
    "planar 4R": lambda: al.planar_arm([0.5, 0.4, 0.3, 0.2], masses=[3.0, 2.0, 1.5, 1.0]),
    "six axes": lambda: al.load_urdf(al.example_urdf("six_axis")),
    "seven axes": lambda: al.load_urdf(al.example_urdf("seven_axis")),
    "tree of 20 joints": lambda: made(branched(4, 4, 4)),
}
ALONE = "chain of 20 links"
# Goals: the largest allowed ratios of armlet's time to the C's time, and, last, the largest extra time of a single call, ns.
ONE, BATCH, TREES, FUNCTION, CALL = 1.25, 1.1, 1.3, 1.2, 200.0
# Goal: the largest allowed ratio of the C's speed-up on two threads to armlet's speed-up.
SPEED_UP = 1.05


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def serial(row: Row) -> bool:
    """Whether the row's arm is a chain of at most seven joints."""
    return row.tree.serial and row.tree.n <= 7


def beyond(pair: Pair) -> float:
    """Time of one armlet call minus time of the C, ns: the median of the differences within a round."""
    ours, theirs = pair.ours.seconds(), pair.theirs.seconds()
    return statistics.median(pair.ours.figure(ours[k]) - pair.theirs.figure(theirs[k]) for k in ours)


def verdict(what: str, goal: float, found: list[tuple[float, Row]], unit: str = "") -> list[reporting.Verdict]:
    """The largest measured figure, its arm and law, and the number of figures that meet the goal."""
    if not found:
        return []
    largest, row = max(found, key=lambda each: each[0])
    met = sum(figure <= goal for figure, _ in found)
    measured = f"at most {largest:.3g}{unit} ({row.arm}, {row.what}); {met} of {len(found)} meet it"
    return [(what, f"<= {goal:g}{unit}", measured, met == len(found))]


def verdicts(loops: list[Row], calls: list[Row]) -> list[reporting.Verdict]:
    chains, trees = [row for row in loops if serial(row)], [row for row in loops if not serial(row)]
    found = verdict("one run, serial arms", ONE, [(row.pairs["one run"].ratio, row) for row in chains])
    for runs in BATCHES:
        name = f"batch of {runs:,}"
        found += verdict(f"{name}, serial arms", BATCH, [(row.pairs[name].ratio, row) for row in chains])
        found += verdict(f"{name}, up to 20 joints", TREES, [(row.pairs[name].ratio, row) for row in trees])
    largest = f"batch of {max(BATCHES):,}"
    lost = [(theirs / ours, row) for row in loops if TWO in row.pairs for ours, theirs in [gains(row.pairs[largest], row.pairs[TWO])]]
    found += verdict("the C's speed-up on two threads over armlet's", SPEED_UP, lost)
    found += verdict(f"functions of {ROWS:,} rows", FUNCTION, [(row.pairs["batch"].ratio, row) for row in calls])
    return found + verdict("a single call beyond the C", CALL, [(beyond(row.pairs["call"]), row) for row in calls], " ns")


def bold(ratio: float, goal: float) -> str:
    return f"{ratio:.2f}" if ratio <= goal else f"**{ratio:.2f}**"


def times(pair: Pair, scale: float = 1.0) -> str:
    return f"{timing.digits(pair.ours.median * scale)} | {timing.digits(pair.theirs.median * scale)}"


def loop_table(rows: list[Row]) -> list[str]:
    """Table of the loops: one run in ns per step, a call of few steps in us, batches in ns per run and step."""
    heads = ["one run", f"{SHORT} steps, us", *(f"batch of {runs:,}" for runs in BATCHES)]
    lines = [
        "| arm, law | operations of the C | " + " | ".join(f"{head}: armlet | C | ratio" for head in heads) + " |",
        "|---|" + "---:|" * 13,
    ]
    for row in rows:
        goal = BATCH if serial(row) else TREES
        cells = [f"{times(row.pairs['one run'])} | {bold(row.pairs['one run'].ratio, ONE if serial(row) else float('inf'))}"]
        cells += [f"{times(row.pairs['short'], 1e-3)} | {row.pairs['short'].ratio:.2f}"]
        cells += [f"{times(found)} | {bold(found.ratio, goal)}" for found in (row.pairs[f"batch of {runs:,}"] for runs in BATCHES)]
        lines.append(f"| {row.arm}, {row.what} | {row.operations:,} | " + " | ".join(cells) + " |")
    return lines


def by_hand_verdicts(by_hand: dict[str, dict[str, Pair]]) -> list[reporting.Verdict]:
    goals = [(name, what, goal) for name in by_hand for what, goal in hand_written.GOALS[name].items()]
    ratios = [(name, what, goal, by_hand[name][what].ratio) for name, what, goal in goals]
    return [(f"{name}, {what} / C by hand", f"<= {goal:g}", f"{ratio:.2f}", ratio <= goal) for name, what, goal, ratio in ratios]


def by_hand_table(by_hand: dict[str, dict[str, Pair]]) -> list[str]:
    """Table of the hand-written loops: single runs in ns per step, batches in ns per run and step, Rosenbrock runs in us."""
    lines = ["| loop | armlet | C | ratio |", "|---|---:|---:|---:|"]
    for name, pairs in by_hand.items():
        for what, pair in pairs.items():
            whole = what == "rodas4"
            goal = hand_written.GOALS[name].get(what, float("inf"))
            cells = f"{times(pair, 1e-3 if whole else 1.0)} | {bold(pair.ratio, goal)}"
            lines.append(f"| {name}, {what}{', us' if whole else ''} | {cells} |")
    return lines


def threads_table(loops: list[Row]) -> list[str]:
    lines = [f"| arm, law | {TWO}: armlet | C | ratio | speed-up: armlet | C |", "|---|" + "---:|" * 5]
    for row in loops:
        one, two = row.pairs[f"batch of {max(BATCHES):,}"], row.pairs[TWO]
        ours, theirs = gains(one, two)
        faster = f"{ours:.2f}" if theirs / ours <= SPEED_UP else f"**{ours:.2f}**"
        lines.append(f"| {row.arm}, {row.what} | {times(two)} | {two.ratio:.2f} | {faster} | {theirs:.2f} |")
    return lines


def function_table(rows: list[Row]) -> list[str]:
    """Table of the functions: batches in ns per row, single calls in ns."""
    lines = ["| arm, function | operations of the C | batch: armlet | C | ratio | C, arranged | ratio | call: armlet | C | beyond |"]
    lines.append("|---|" + "---:|" * 9)
    for row in rows:
        batch, arranged, call = (row.pairs[name] for name in ("batch", "arranged", "call"))
        extra = beyond(call)
        cells = [f"{times(batch)} | {bold(batch.ratio, FUNCTION)}", f"{timing.digits(arranged.theirs.median)} | {arranged.ratio:.2f}"]
        cells += [f"{times(call)} | " + (f"{extra:.0f}" if extra <= CALL else f"**{extra:.0f}**")]
        lines.append(f"| {row.arm}, {row.what} | {row.operations:,} | " + " | ".join(cells) + " |")
    return lines


def compiler() -> str:
    return subprocess.run(["g++", "-dumpfullversion"], capture_output=True, text=True, check=True).stdout.strip()


def report(
    loops: list[Row], calls: list[Row], by_hand: dict[str, dict[str, Pair]], others: list[Case], cases: list[Case], busy: float
) -> str:
    text = [reporting.heading(cases, busy) + f" CasADi {casadi.CasadiMeta.version()}, g++ {compiler()}.", ""]
    text += reporting.target_table(verdicts(loops, calls) + by_hand_verdicts(by_hand))
    if loops:
        text += ["", "**Closed loops: ns per step, and per run and step**", "", *loop_table(loops)]
    if any(TWO in row.pairs for row in loops):
        text += ["", "**Two threads: ns per run and step**", "", *threads_table(loops)]
    if by_hand:
        text += ["", "**C written by hand: ns per step, and per run and step**", "", *by_hand_table(by_hand)]
    if calls:
        text += ["", f"**Functions: ns per row of {ROWS:,}, and ns per call**", "", *function_table(calls)]
    if others:
        text += ["", timing.markdown(timing.rows(others))]
    return "\n".join(text)


def steps_of(arm: al.Arm) -> int:
    return 5000 if arm.n <= 7 else 500


def main() -> None:
    parser = reporting.arguments("armlet beside generated straight-line C")
    parser.add_argument("--arms", nargs="*", default=[*ARMS, ALONE], help=f"{', '.join(ARMS)}, {ALONE}, or files of URDF")
    parser.add_argument("--laws", nargs="*", default=list(LAWS), help=", ".join(LAWS))
    parser.add_argument("--functions", action=argparse.BooleanOptionalAction, default=True, help="time the functions of the arms as well")
    options = parser.parse_args()
    reporting.require_release("bench_generated_c")
    share, loops, calls, others = timing.busy(), [], [], []
    for name in options.arms:
        if name == ALONE:
            others += alone(ALONE, Laws(made(branched(20, 0, 0)), 500), LAWS[0], 500)
            continue
        arm = ARMS[name]() if name in ARMS else al.load_urdf(name)
        label, laws = Path(name).stem, Laws(arm, steps_of(arm))
        for law in options.laws:
            say(f"{label}, {law}")
            loops.append(loop_row(label, laws, law, steps_of(arm)))
        for what, function in functions(arm).items() if options.functions else ():
            say(f"{label}, {what}")
            calls.append(function_row(label, arm, what, function))
    others += [numpy_call()] if options.functions else []
    by_hand = hand_written.rows(say)
    pairs = [pair for row in loops + calls for pair in row.pairs.values()] + [pair for found in by_hand.values() for pair in found.values()]
    cases = others + [case for pair in pairs for case in (pair.ours, pair.theirs)]
    timing.measure(cases, options.rounds, options.core, say)
    reporting.finish("generated_c", report(loops, calls, by_hand, others, cases, share), options.readme)


if __name__ == "__main__":
    main()
