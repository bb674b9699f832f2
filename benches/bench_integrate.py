"""Time and error of `al.integrate` on Python callables, compared with scipy's solve_ivp and, if installed, numbalsoda and diffrax.

    python -P benches/bench_integrate.py              # tables
    python -P benches/bench_integrate.py --readme     # the tables, written into benches/README.md

benches/work_precision.py plots error against time. The error is the difference from the known final state of the problem
(`armlet.reference.problems`). The time is processor time, the shortest of several interleaved rounds.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import armlet as al
from armlet.reference.problems import PROBLEMS, Problem

SCIPY = {"dopri5": "RK45", "dop853": "DOP853", "radau5": "Radau"}
TOLERANCES = (1e-4, 1e-6, 1e-8)
README = Path(__file__).with_name("README.md")
BEGIN, END = "<!-- integrate: begin -->", "<!-- integrate: end -->"

Solver = Callable[[], np.ndarray]


def armlet(problem: Problem, method: str, tol: float, lists: bool) -> Solver:
    def run() -> np.ndarray:
        return al.integrate(
            problem.f, problem.span, problem.y0, method=method, rtol=tol, atol=tol * problem.scale, jac=problem.jac, lists=lists
        ).y[-1]

    return run


def scipy(problem: Problem, method: str, tol: float) -> Solver:
    jac = {"jac": problem.jac} if problem.jac and method in ("Radau", "BDF", "LSODA") else {}

    def run() -> np.ndarray:
        return solve_ivp(problem.f, problem.span, problem.y0, method=method, rtol=tol, atol=tol * problem.scale, **jac).y[:, -1]

    return run


def under_scipy(problem: Problem, method: str, tol: float) -> Solver:
    def run() -> np.ndarray:
        return solve_ivp(
            problem.f, problem.span, problem.y0, method=al.scipy_method(method), rtol=tol, atol=tol * problem.scale, jac=problem.jac
        ).y[:, -1]

    return run


def diffrax(problem: Problem, tol: float) -> Solver | None:
    try:
        import diffrax as dx
        import jax
        import jax.numpy as jnp
    except ImportError:
        return None
    jax.config.update("jax_enable_x64", True)
    if problem.name == "pleiades":
        return None
    solver = dx.Kvaerno5() if problem.stiff else dx.Dopri8()
    control = dx.PIDController(rtol=tol, atol=tol * problem.scale)

    @jax.jit
    def solve(y: Any) -> Any:
        field = dx.ODETerm(lambda t, y, args: jnp.stack([jnp.asarray(x) for x in problem.f(t, y)]))
        return dx.diffeqsolve(field, solver, *problem.span, None, y, stepsize_controller=control, max_steps=10**5).ys[-1]

    y0 = jnp.asarray(problem.y0, dtype=jnp.float64)
    return lambda: np.asarray(solve(y0).block_until_ready())


def numbalsoda(problem: Problem, tol: float) -> Solver | None:
    """numbalsoda's dop853 or lsoda on a right-hand side compiled by numba."""
    try:
        import numba
        import numbalsoda as nl
    except ImportError:
        return None
    if problem.name == "pleiades":
        return None
    f, n = numba.njit(problem.f), len(problem.y0)

    @numba.cfunc(nl.lsoda_sig)
    def field(t: float, y: Any, dy: Any, _: Any) -> None:
        values = f(t, numba.carray(y, (n,)))
        for i in range(n):
            dy[i] = values[i]

    # Versions without dop853 have lsoda alone. It allows at most 500 steps between two outputs, so 1,000 outputs are requested.
    solver = nl.dop853 if hasattr(nl, "dop853") and not problem.stiff else nl.lsoda
    y0, times = np.array(problem.y0, dtype=np.float64), np.linspace(*problem.span, 1000)
    return lambda _keep=field: solver(field.address, y0, times, rtol=tol, atol=tol * problem.scale)[0][-1]


def cases(problem: Problem, tol: float) -> dict[str, Solver]:
    found: dict[str, Solver] = {}
    for method in ("radau5", "rodas4") if problem.stiff else ("dopri5", "dop853"):
        found[f"armlet {method}"] = armlet(problem, method, tol, False)
        found[f"armlet {method}, lists"] = armlet(problem, method, tol, True)
        if method in SCIPY:
            found[f"scipy {SCIPY[method]}"] = scipy(problem, SCIPY[method], tol)
            found[f"scipy with scipy_method({method})"] = under_scipy(problem, method, tol)
    found["scipy LSODA"] = scipy(problem, "LSODA", tol)
    for name, peer in (("diffrax", diffrax), ("numbalsoda", numbalsoda)):
        solver = peer(problem, tol)
        if solver is not None and solves(problem, solver):
            found[f"{name}, compiled f"] = solver
        elif solver is not None:
            print(f"{name} does not solve {problem.name} at {tol:.0e}: left out", file=sys.stderr)
    return found


def solves(problem: Problem, solver: Solver) -> bool:
    """Whether a peer's solver reaches the end of the problem. This first call also compiles it."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            return problem.error(solver()) < 0.9
    except Exception:  # each library has a different exception for failure
        return False


def best(solvers: dict[str, Solver], rounds: int) -> dict[str, float]:
    """The shortest processor time of each case, s. Every round runs every case once."""
    times = dict.fromkeys(solvers, np.inf)
    for _ in range(rounds):
        for name, solver in solvers.items():
            began = time.process_time()
            solver()
            times[name] = min(times[name], time.process_time() - began)
    return times


def measure(rounds: int, wanted: Callable[[str], bool] = lambda name: True) -> list[tuple[str, float, str, float, float]]:
    """Rows (problem, tolerance, case, seconds, error)."""
    rows = []
    for problem in PROBLEMS.values():
        for tol in TOLERANCES:
            solvers = {name: solver for name, solver in cases(problem, tol).items() if wanted(name)}
            errors = {name: problem.error(solver()) for name, solver in solvers.items()}
            for name, seconds in best(solvers, rounds).items():
                rows.append((problem.name, tol, name, seconds, errors[name]))
    return rows


def table(rows: list[tuple[str, float, str, float, float]]) -> str:
    times = {(problem, tol, name): seconds for problem, tol, name, seconds, _ in rows}
    least = {
        kind: min(
            times[p, tol, f"scipy {SCIPY[m]}"] / seconds
            for (p, tol, name), seconds in times.items()
            for m in SCIPY
            if name == f"armlet {m}{kind}" and p != "pleiades"
        )
        for kind in ("", ", lists")
    }
    lines = [
        "With equal method, tolerance and function, `al.integrate` is faster than `solve_ivp`. Systems of 2 to 8 states are at "
        f"least {least['']:.1f} times faster with the state as an array, {least[', lists']:.1f} as a list (target 3). Both times include "
        "the time of the right-hand side. For Arenstorf's orbit, which computes with numpy scalars, the right-hand side takes most of "
        "armlet's time. The right-hand side also takes most of armlet's time for the Pleiades, which compute with arrays of 7 x 7.",
        "",
        "| problem | tolerance | case | ms | error | scipy's time / time |",
        "|---|---:|---|---:|---:|---:|",
    ]
    for problem, tol, name, seconds, error in rows:
        mine = next((m for m in SCIPY if name.startswith(f"armlet {m}") or name == f"scipy with scipy_method({m})"), None)
        ratio = f"{times[problem, tol, f'scipy {SCIPY[mine]}'] / seconds:.1f}" if mine else ""
        lines.append(f"| {problem} | {tol:.0e} | {name} | {1e3 * seconds:.2f} | {error:.1e} | {ratio} |")
    return "\n".join(lines)


def write(text: str, begin: str, end: str) -> None:
    """Replace the text between two marks of benches/README.md by `text`."""
    head, _, rest = README.read_text().partition(begin)
    README.write_text(f"{head}{begin}\n{text}\n{end}{rest.partition(end)[2]}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--readme", action="store_true", help="write the table into benches/README.md")
    arguments = parser.parse_args()
    rows = measure(arguments.rounds)
    text = table(rows)
    print(text)
    if arguments.readme:
        write(text, BEGIN, END)
    return 0


if __name__ == "__main__":
    sys.exit(main())
