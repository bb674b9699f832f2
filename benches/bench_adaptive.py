"""M(q) a + S(q, v) v = tau under the adaptive law, RK4 at 1 ms: time of armlet, numpy, scipy, numba and C.

Every final state is compared with an accurate reference before any time is measured. benches/README.md explains the comparison.

    python benches/bench_adaptive.py                  the table, and benches/results/adaptive.json
    python benches/bench_adaptive.py --markdown       the table as Markdown
    python benches/bench_adaptive.py --readme         the table, written into benches/README.md
"""

from __future__ import annotations

import functools
import importlib.util
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))  # `python -P` does not add this folder
import adaptive_cases as cases
import adaptive_peers as peers
import reporting
import timing
from timing import Case

import armlet as al

HERE = Path(__file__).parent
ISAS = ("baseline", "avx2", "avx512")
CALLS, ROWS, IN_A_ROW = 5_000, 100_000, 50
C, C_BATCH, NUMBA, NUMBA_BATCH = "C, by hand", "C with AVX-512, by hand", "numba, scalars", "numba, batch"
ONE, BATCH, BATCH2 = "armlet", "armlet, batch", "armlet, batch, 2 threads"
DOP853, NUMBALSODA, AFTER = "armlet, dop853", "numbalsoda, dop853", ", after other work"
# Largest allowed differences. The truncation error of RK4 at 1 ms is 1.1e-10 here, that of DOP853 at rtol 1e-8 is 6e-11. Two
# implementations of RK4 differ only by rounding, because the closed loop is contracting.
TRUNCATION, ROUNDING = 1e-9, 1e-12


def say(text: str) -> None:
    print(f"bench_adaptive: {text}", file=sys.stderr, flush=True)


def compare(name: str, answer: Any, reference: Any, tolerance: float) -> None:
    worst = float(np.max(np.abs(np.asarray(answer) - reference)))
    if not worst <= tolerance:
        raise SystemExit(f"bench_adaptive: {name} differs from the reference by {worst:.1e}: expected at most {tolerance:.0e}")
    say(f"equal within {tolerance:.0e} (worst {worst:.1e}): {name}")


class Suite:
    """The list of cases. `add` accepts a case only if its final state is correct."""

    def __init__(self, core: int, two: bool) -> None:
        self.cases: list[Case] = []
        self.core, self.two = core, two
        self.busy = timing.busy()
        self.motion, self.short = peers.table(peers.STEPS), peers.table(peers.BATCH_STEPS)
        self.exact = cases.adaptive_method(1e-13, 1e-14)()
        self.full = peers.numpy_loop(peers.STEPS, full=True)
        self.many = peers.numpy_batch(peers.BATCH_STEPS)

    def add(self, group: str, name: str, run: Callable[[], Any], per: float, check: tuple[Any, float] | None = None, **more: Any) -> None:
        if more.get("threads", 1) > 1 and not self.two:
            return say(f"skipped: {name}: one core")
        if check is not None:
            compare(name, run(), *check)
        self.cases.append(Case(group, name, run, per, **more))

    def singles(self, c: peers.LimitKernels | None, numba: dict[str, Callable[..., Any]] | None) -> None:
        group = "One run, 10,000 steps: ns per step"
        yard = C if c else NUMBA if numba else None
        add = functools.partial(self.add, group, per=peers.STEPS)
        exact = (self.exact, TRUNCATION)
        if c:
            add(C, lambda: c.single(self.motion, peers.STEPS), check=exact)
        table, wave = cases.tabulated(peers.STEPS), cases.sinusoid()
        add(ONE, cases.single(table), check=exact, against=yard)
        add("armlet, Sinusoid in the loop", cases.single(wave), check=exact, against=ONE)
        add("armlet, full gain matrices", cases.single(table, full=True), check=(self.full, ROUNDING), against=ONE)
        add("armlet, record_every=1", cases.single(table, record_every=1), check=exact, against=ONE)
        add("armlet, monitors", cases.single(table, monitors=True), check=exact, against=ONE)
        everything = cases.single(wave, full=True, record_every=1, monitors=True)
        add("armlet, all four options together", everything, check=(self.full, TRUNCATION), against=ONE)
        if numba:
            inputs = (np.array(peers.PLANT), peers.start(), self.motion, peers.STEPS, peers.H)
            add(NUMBA, lambda: numba["scalars"](*inputs), check=exact, against=ONE)
            add("numba, small arrays", lambda: numba["arrays"](*inputs), check=exact, against=ONE)
        compare("numpy loop", peers.numpy_loop(peers.STEPS), *exact)
        self.add(group, "numpy loop", lambda: peers.numpy_loop(500), 500, against=ONE)

    def adaptive_methods(self) -> None:
        group, per = "One run of 10 s, dop853, rtol 1e-8: ns per simulated ms", peers.T * 1e3
        exact = (self.exact, TRUNCATION)
        # One run is so short that its time depends on the content of the caches. So each solver is timed twice: many calls in a row, and
        # one call after other work.
        peer = timing.if_there("numbalsoda", lambda: peers.numbalsoda_dop853(1e-8, 1e-10), say)
        for name, once in ((DOP853, cases.adaptive_method(1e-8, 1e-10)), (NUMBALSODA, peer)):
            if once is not None:
                ours = name == DOP853
                self.add(group, name, in_a_row(once), IN_A_ROW * per, exact, against=None if ours else DOP853)
                self.add(group, name + AFTER, once, per, exact, against=None if ours else DOP853 + AFTER)
        if importlib.util.find_spec("scipy") is None:
            return say("skipped: scipy: not installed")
        compare("scipy DOP853, rtol 1e-12, the reference itself", peers.scipy_dop853(1e-12, 1e-13)[0], self.exact, 1e-9)
        for name, arrays in (("scipy, DOP853", False), ("scipy, DOP853, right-hand side of small arrays", True)):
            self.add(group, name, functools.partial(scipy_end, arrays), per, exact, against=DOP853)

    def batches(self, c: peers.LimitKernels | None, numba: dict[str, Callable[..., Any]] | None) -> None:
        group, per = "1,024 runs, 1,000 steps: ns per run and step", peers.RUNS * peers.BATCH_STEPS
        many = (self.many, ROUNDING)
        yard = C_BATCH if c else NUMBA_BATCH if numba else None
        if c:
            self.add(group, C_BATCH, functools.partial(c.batch, self.short, peers.BATCH_STEPS, 1), per, many)
            both = functools.partial(c.batch, self.short, peers.BATCH_STEPS, 2)
            self.add(group, f"{C_BATCH}, 2 threads", both, per, many, threads=2, against=C_BATCH)
        self.add(group, BATCH, cases.batch(1), per, many, against=yard)
        self.add(group, BATCH2, cases.batch(2), per, many, threads=2, against=BATCH)
        self.add(group, "armlet, batch, Sinusoid in the loop", cases.batch(1, motion=cases.sinusoid()), per, many, against=BATCH)
        self.add(group, "armlet, batch, monitors", cases.batch(1, monitors=True), per, many, against=BATCH)
        everything = cases.batch(1, keep="all", record_every=10)
        self.add(group, 'armlet, batch, keep="all", record_every=10', everything, per, against=BATCH)
        if numba:
            inputs = (peers.batch_inputs()[0], peers.start(peers.batch_inputs()[1]), self.short, peers.BATCH_STEPS, peers.H)
            self.add(group, NUMBA_BATCH, lambda: numba["batch"](*inputs), per, many, against=BATCH)
            self.add(group, f"{NUMBA_BATCH}, 2 threads", lambda: numba["parallel"](*inputs), per, many, threads=2, against=BATCH2)
        self.add(group, "numpy, vectorised over the runs", lambda: peers.numpy_batch(20), 20 * peers.RUNS, against=BATCH)

    def routes(self, c: peers.LimitKernels | None) -> list[cases.Route]:
        best = ISAS.index(al.build_info()["best_instruction_set"])
        routes = []
        for isa in ISAS[: best + 1]:
            route = cases.Route(isa)
            routes.append(route)
            compare(f"ARMLET_ISA={isa}, one run", route.ask("state:single"), cases.single(cases.tabulated(peers.STEPS))(), 1e-12)
            compare(f"ARMLET_ISA={isa}, batch", route.ask("state:batch"), cases.batch(1)(), 1e-12)
            for what, per, yard in (
                ("single", float(peers.STEPS), C if c else ONE),
                ("batch", float(peers.RUNS * peers.BATCH_STEPS), C_BATCH if c else BATCH),
            ):
                group = "ARMLET_ISA, each in its own process: ns per step, or per run and step"
                run = functools.partial(route.ask, what, self.core)
                self.add(group, f"{isa}, {'one run' if what == 'single' else what}", run, per, timed=True, against=yard)
        return routes

    def targets(self) -> list[tuple[str, str, str, bool]]:
        return targets(self.cases, busy=self.busy > 0.1)

    def calls(self) -> None:
        for name, loop in cases.calls(CALLS):
            self.add("One Python call: ns", name, loop, CALLS)
        for name, loop in cases.rows_of_calls(ROWS):
            self.add("One Python call: ns", name, loop, ROWS)
        self.add(
            "Import time minus the import time of numpy: ms",
            "import armlet",
            cases.import_seconds,
            1.0,
            unit="ms",
            scale=1e3,
            timed=True,
            rounds=7,
            clock="wall",
        )


def scipy_end(arrays: bool) -> Any:
    return peers.scipy_dop853(1e-8, 1e-10, arrays)[0]


def in_a_row(once: Callable[[], Any]) -> Callable[[], Any]:
    """A function that calls `once` `IN_A_ROW` times and returns the last result."""

    def run() -> Any:
        for _ in range(IN_A_ROW - 1):
            once()
        return once()

    return run


def targets(found: list[Case], busy: bool) -> list[tuple[str, str, str, bool]]:
    """Rows (what, target, measured, met) of the cases that this run measured.

    On a busy machine wall times of two threads are inconclusive.
    """
    by_name = {case.name: case for case in found}
    lines = []

    def ratio(what: str, name: str, yard: str, limit: float, at_least: bool = False) -> None:
        if name in by_name and yard in by_name:
            value = timing.ratio(by_name[name], by_name[yard])
            value = 1.0 / value if at_least else value
            note = " on a busy machine: not conclusive" if busy and "wall" in (by_name[name].clock, by_name[yard].clock) else ""
            met = value >= limit if at_least else value <= limit
            lines.append((what, f"{'>=' if at_least else '<='} {limit}", f"{value:.2f}{note}", met))

    def ceiling(what: str, name: str, limit: float, unit: str, less: str | None = None, share: float = 1.0) -> None:
        if name in by_name:
            value = by_name[name].median - (share * by_name[less].median if less in by_name else 0.0)
            lines.append((what, f"<= {limit:g} {unit}", f"{timing.digits(value)} {unit}", value <= limit))

    ratio("one run / C by hand", ONE, C, 1.4)
    ratio("one run / C by hand (aim)", ONE, C, 1.15)
    ratio("one run / numba scalars", ONE, NUMBA, 1.0)
    ratio("batch, AVX2 + FMA / C with AVX-512", "avx2, batch", C_BATCH, 2.0)
    ratio("batch, AVX-512 / C with AVX-512", "avx512, batch", C_BATCH, 1.3)
    ratio("batch, AVX-512 / C with AVX-512 (aim)", "avx512, batch", C_BATCH, 1.15)
    ratio("dop853 / numbalsoda's", DOP853, NUMBALSODA, 1.0)
    ratio("batch: two threads over one", BATCH2, BATCH, 1.8, at_least=True)
    ceiling("mass_matrix: call minus computing time", "arm.mass_matrix(q), PR", 250, "ns", "mass_matrix per row of a batch, PR")
    arithmetic = "inverse_dynamics per row of a batch, PR"
    ceiling("inverse_dynamics: call minus computing time", "arm.inverse_dynamics(q, v, a), PR", 250, "ns", arithmetic)
    # One stage of the loop evaluates the motion, the law and the plant. A quarter of an RK4 step is therefore slightly more than the law's
    # computing time.
    ceiling("law: call minus computing time", "law(t, q, v), Adaptive, PR", 250, "ns", "armlet, Sinusoid in the loop", 0.25)
    ceiling("import armlet minus import numpy", "import armlet", 150, "ms")
    return lines


def main() -> None:
    parser = reporting.arguments("armlet beside its peers on the adaptive PR robot")
    options = parser.parse_args()
    reporting.require_release("bench_adaptive")

    os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # idle threads of numba must not use processor time during the next case
    suite = Suite(options.core, len(timing.cores()) > 1)
    c = timing.if_there("hand-written C", peers.LimitKernels, say)
    numba = timing.if_there("numba", peers.numba_kernels, say)
    routes: list[cases.Route] = []
    try:
        suite.singles(c, numba)
        suite.adaptive_methods()
        suite.batches(c, numba)
        routes = suite.routes(c)
        suite.calls()
        timing.measure(suite.cases, options.rounds, options.core, say)
    finally:
        for route in routes:
            route.close()
    about = {"machine": timing.machine(), "busy": suite.busy, "build": al.build_info(), "targets": suite.targets()}
    timing.save(HERE / "results" / "adaptive.json", suite.cases, about)
    text = reporting.report(suite.cases, suite.targets(), suite.busy, options.markdown or options.readme)
    reporting.finish("adaptive", text, options.readme)


if __name__ == "__main__":
    main()
