"""Stacks with bounds: six levels on seven joints, beside DAQP (hierarchical, lexicographic) and a chain of quadratic programs (quadprog).

The levels are speed bounds, tip velocity, interval of the elbow, orientation, interval of a joint, posture. Times are medians per call from
Python, in us, and ratios to armlet. Every peer must violate the levels as little as armlet, in lexicographic order. A peer that is not
installed is skipped. Kept directions (`scale="direction"`) have other answers, and no peer. Stacks that meet no bound have a tenth of the
commands: they need no search, and a batch solves one per SIMD lane. Two levels on four joints without bounds show
what a solution object costs, which copies the stack for `why`.

    python -P benches/bench_hierarchy.py
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
import timing

Levels = list[tuple[np.ndarray, np.ndarray, np.ndarray]]
STACKS, ROUNDS = 200, 15
# The tolerance of the peers, relative to the sizes of the tasks. Armlet's certificate is 1e-9.
LEXICOGRAPHIC = 1e-6


def say(text: str) -> None:
    print(f"bench_hierarchy: {text}", file=sys.stderr, flush=True)


def stacks(rng: np.random.Generator) -> list[Levels]:
    """The levels below the speed bounds, which are 1 rad/s."""
    found = []
    for _ in range(STACKS):
        tip, elbow, turn = (rng.normal(size=(m, 7)) for m in (3, 2, 3))
        elbow[:, 4:] = 0.0
        wanted, turned, posture = (rng.normal(size=m) * size for m, size in ((3, 0.8), (3, 0.8), (7, 0.5)))
        joint = np.eye(7)[3:4]
        found.append(
            [
                (tip, wanted, wanted),
                (elbow, np.array([-0.2, -0.3]), np.array([0.3, 0.2])),
                (turn, turned, turned),
                (joint, np.array([-0.3]), np.array([0.2])),
                (np.eye(7), posture, posture),
            ]
        )
    return found


def violations(levels: Levels, x: np.ndarray) -> list[float]:
    return [float(np.linalg.norm(A @ x - np.clip(A @ x, low, high))) for A, low, high in levels]


def worse(levels: Levels, x: np.ndarray, other: np.ndarray) -> bool:
    """Whether `x` violates a level more than `other`, and no level above less."""
    if not np.isfinite(x).all():
        return True
    for own, better in zip(violations(levels, x), violations(levels, other), strict=True):
        if abs(own - better) > LEXICOGRAPHIC:
            return own > better
    return False


def daqp_peer() -> Callable[[Levels], np.ndarray]:
    import daqp

    def solve(levels: Levels) -> np.ndarray:
        A = np.vstack([level[0] for level in levels])
        low = np.r_[-np.ones(7), *(level[1] for level in levels)]
        high = np.r_[np.ones(7), *(level[2] for level in levels)]
        ends = np.cumsum([7, *(len(level[1]) for level in levels)]).astype(np.int32)
        answer = daqp.solve(None, None, A, high, low, np.zeros(len(low), dtype=np.int32), ends, primal_tol=1e-11)
        return np.asarray(answer[0])

    return solve


def quadprog_peer() -> Callable[[Levels], np.ndarray]:
    import quadprog

    def solve(levels: Levels) -> np.ndarray:
        """A chain: each level has slacks, and the slacks of the levels above are constants. 1e-9 makes the Hessian definite."""
        rows, low, high = np.eye(7), -np.ones(7), np.ones(7)
        x = np.zeros(7)
        for A, lower, upper in levels:
            m = len(lower)
            H = np.diag(np.r_[np.full(7, 1e-9), np.ones(m)])
            G = np.vstack([np.c_[rows, np.zeros((len(rows), m))], np.c_[A, -np.eye(m)]])
            bounds = np.r_[low, lower], np.r_[high, upper]
            try:
                x = quadprog.solve_qp(H, np.zeros(7 + m), np.vstack([G, -G]).T, np.r_[bounds[0], -bounds[1]] - 1e-9)[0]
            except ValueError:
                return np.full(7, np.inf)
            w = x[7:]
            rows, low, high = np.vstack([rows, A]), np.r_[low, lower + w], np.r_[high, upper + w]
        return np.asarray(x[:7])

    return solve


def main() -> None:
    problems = stacks(np.random.default_rng(0))
    targets = [[al.Within(low, high) if (low < high).any() else low for _, low, high in levels] for levels in problems]
    jacobians = [[A for A, _, _ in levels] for levels in problems]
    solver = al.PrioritySolver(7, [len(low) for _, low, _ in problems[0]], method="exact", v_max=1.0)
    found = [al.solve_priority(J, t, method="exact", v_max=1.0) for J, t in zip(jacobians, targets, strict=True)]
    assert max(sol.certificate for sol in found) <= 1e-9

    def last_set() -> None:
        for J, target in zip(jacobians, targets, strict=True):
            for _ in range(5):
                solver.solve(J, target)

    def from_the_start() -> None:
        for J, target in zip(jacobians, targets, strict=True):
            al.solve_priority(J, target, method="exact", v_max=1.0)

    batch = [np.array(level) for level in zip(*jacobians, strict=True)]
    lower = [np.array([levels[k][1] for levels in problems]) for k in range(5)]
    upper = [np.array([levels[k][2] for levels in problems]) for k in range(5)]
    bounds: list[Any] = [al.Within(low, high) if (low < high).any() else low for low, high in zip(lower, upper, strict=True)]
    tenth: list[Any] = [target if isinstance(target, al.Within) else 0.1 * target for target in bounds]
    trial = al.solve_priority(batch, tenth, method="exact", v_max=1.0)
    free = [i for i in range(STACKS) if trial.changes[i] == 0 and not trial.limits((i,)) and not any(trial.active((i,)))]
    assert len(free) > STACKS // 2
    free_rows = [level[free] for level in batch]
    free_bounds = [al.Within(level.lower[free], level.upper[free]) if isinstance(level, al.Within) else level[free] for level in tenth]
    free_targets = [[target if isinstance(target, al.Within) else 0.1 * target for target in targets[i]] for i in free]

    def meets_none() -> None:
        for i, target in zip(free, free_targets, strict=True):
            al.solve_priority(jacobians[i], target, method="exact", v_max=1.0)

    cases: dict[str, tuple[Callable[[], Any], int]] = {
        "armlet, last active set (1 of 5 calls without)": (last_set, 5 * STACKS),
        "armlet, solve_priority": (from_the_start, STACKS),
        "armlet, row of a batch": (lambda: al.solve_priority(batch, bounds, method="exact", v_max=1.0), STACKS),
        "armlet, solve_priority, no bound is met": (meets_none, len(free)),
        "armlet, row of a batch, no bound is met": (
            lambda: al.solve_priority(free_rows, free_bounds, method="exact", v_max=1.0),
            len(free),
        ),
    }

    def directions() -> None:
        for J, target in zip(jacobians, targets, strict=True):
            al.solve_priority(J, target, method="exact", v_max=1.0, scale="direction")

    plain, commands = [J[:2, :4].copy() for J in jacobians[0][:2]], [np.ones(2), np.ones(2)]

    def without_bounds() -> None:
        solution = None
        for _ in range(50 * STACKS):
            # As in a control loop, the last solution exists until the next one replaces it.
            solution = al.solve_priority(plain, commands)
        assert solution is not None

    cases |= {
        "armlet, kept directions": (directions, STACKS),
        "armlet, two levels without bounds": (without_bounds, 50 * STACKS),
    }
    for name, make in (("DAQP, hierarchical", daqp_peer), ("quadprog, a chain", quadprog_peer)):
        peer = timing.if_there(name, make, say)
        if peer is None:
            continue
        answers = [peer(levels) for levels in problems]
        triples = list(zip(problems, found, answers, strict=True))
        losses = sum(worse(levels, sol.v, x) and not worse(levels, x, sol.v) for levels, sol, x in triples)
        assert losses == 0, f"{name} is lexicographically better in {losses} stacks"
        gains = sum(worse(levels, x, sol.v) for levels, sol, x in triples)
        say(f"{name}: lexicographically worse than armlet in {gains} of {STACKS} stacks")
        cases[name] = ((lambda peer=peer: [peer(levels) for levels in problems]), STACKS)
    times: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(ROUNDS):
        for name, (run, per) in cases.items():
            times[name].append(timing.clocked(run)[1] / per * 1e6)
    first = statistics.median(next(iter(times.values())))
    for name, seconds in times.items():
        print(f"{name:50} {statistics.median(seconds):8.1f} us {statistics.median(seconds) / first:8.2f}")


if __name__ == "__main__":
    main()
