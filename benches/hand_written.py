"""The closed loops of the PR robot and of the elastic 2R arm, by armlet and by C kernels that were written by hand."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import adaptive_cases
import adaptive_peers
import bench_elastic
import elastic_peers
import numpy as np
import timing
from generated_cases import TWO, Pair, require_equal

PR, ELASTIC = "PR robot, adaptive", "elastic 2R, impedance"
# Goals: the largest allowed ratios of armlet's time to the C's time.
GOALS = {PR: {"one run": 1.15, "batch of 1,024": 1.25}, ELASTIC: {"one run": 1.15, "batch of 1,024": 1.35, "rodas4": 1.2}}
STIFF = "mild"
# Largest allowed difference of two Rosenbrock programs, which agree only within their tolerances.
SOLVED = 1e-6


def pr_robot() -> dict[str, Pair]:
    """Pairs for the PR robot: RK4 at 1 ms, law in every stage, tabulated motion. The C is `native/p1.cpp`."""
    peers, cases, c = adaptive_peers, adaptive_cases, adaptive_peers.LimitKernels()
    long, short, runs = peers.table(peers.STEPS), peers.table(peers.BATCH_STEPS), peers.RUNS * peers.BATCH_STEPS
    one, theirs = cases.single(cases.tabulated(peers.STEPS)), partial(c.single, long, peers.STEPS)
    many = {threads: (cases.batch(threads), partial(c.batch, short, peers.BATCH_STEPS, threads)) for threads in (1, 2)}
    require_equal(PR, one(), theirs())
    require_equal(f"{PR}, batch", *(run() for run in many[1]))
    pairs = {"one run": Pair.of("one run", PR, one, theirs, peers.STEPS), "batch of 1,024": Pair.of("batch of 1,024", PR, *many[1], runs)}
    if len(timing.cores()) > 1:
        pairs[TWO] = Pair.of(TWO, PR, *many[2], runs, threads=2)
    return pairs


def elastic() -> dict[str, Pair]:
    """Pairs for the elastic arm: RK4 at 0.2 ms, and 2 s by a Rosenbrock method with Jacobians by dual numbers. The C is `native/p3.cpp`."""
    peers, c = elastic_peers, elastic_peers.LimitKernels()
    one, many = bench_elastic.single(), bench_elastic.batch()
    require_equal(ELASTIC, one(), c.single())
    require_equal(f"{ELASTIC}, batch", many(), c.batch())
    solved: Callable[[], Any] = bench_elastic.stiff(STIFF, "rodas4")
    wide = partial(c.rosenbrock, STIFF, True)
    ends = [np.asarray(run()) for run in (solved, wide)]
    require_equal(f"{ELASTIC}, rodas4", *ends, tolerance=SOLVED)
    return {
        "one run": Pair.of("one run", ELASTIC, one, c.single, peers.STEPS),
        "batch of 1,024": Pair.of("batch of 1,024", ELASTIC, many, c.batch, peers.RUNS * peers.BATCH_STEPS),
        "rodas4": Pair.of("rodas4", ELASTIC, solved, wide, 1),
    }


def rows(say: Callable[[str], None]) -> dict[str, dict[str, Pair]]:
    """Timed pairs by loop and case, only of loops whose C kernels exist."""
    found = {PR: timing.if_there("native/p1.cpp", pr_robot, say), ELASTIC: timing.if_there("native/p3.cpp", elastic, say)}
    return {name: pairs for name, pairs in found.items() if pairs is not None}
