"""What a user calls beside the loops in it: sweeps, environments, searches for gains, and single steps, with equal answers asserted first.

- `sweep` of sampled runs beside `simulate_batch` of the same plants, laws and starts.
- `ArmVectorEnv.step` beside the native steps of the same torques.
- `tune` beside `simulate_batch` of its candidates, generation by generation.
- `Simulator.step`, one call per step, beside `simulate` of the same loop.

    python -P benches/bench_user_loops.py              the tables
    python -P benches/bench_user_loops.py --readme     the tables, written into benches/README.md
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al
from armlet.gym import ArmVectorEnv
from armlet.gym.stepping import Stepper

sys.path.insert(0, str(Path(__file__).parent))  # `python -P` does not add this folder
import reporting
import timing
from timing import Case

GOAL = 1.3
RUNS, ENVIRONMENTS, STEPS = 10_000, 1024, 1000
CANDIDATES, GENERATIONS = 64, 9
ARMS: dict[str, dict[str, Any]] = {
    "planar 2R": {"kind": "planar_arm", "lengths": [0.5, 0.4], "masses": [3.0, 2.0]},
    "six axes": {"kind": "example", "name": "six_axis"},
}
VARY = {
    "law.kp[0]": {"uniform": [20.0, 80.0]},
    "law.kd[1]": {"uniform": [5.0, 15.0]},
    "run.q0[0]": {"uniform": [-0.2, 0.2]},
}
GAINS = {path: VARY[path] for path in ("law.kp[0]", "law.kd[1]")}
Pair = tuple[str, int, str, Callable[[], Any], Callable[[], Any]]


def scenario_of(arm: dict[str, Any], n: int) -> al.Scenario:
    """Computed torque along a quintic motion of 1.5 s, sampled at 1 kHz."""
    motion = {"kind": "Quintic", "q0": [0.0] * n, "q1": [0.4] * n, "duration": 1.2}
    law = {"kind": "ComputedTorque", "kp": [50.0] * n, "kd": [10.0] * n}
    return al.Scenario({"arm": arm, "motion": motion, "law": law, "run": {"q0": [0.1] * n, "t_end": 1.5, "dt": 1e-3, "sample_time": 1e-3}})


def batch_of(scenario: al.Scenario, table: Any) -> Callable[[], Any]:
    """The runs of a table of a sweep or a search as one batch of laws."""
    built = scenario.build()
    arm, rows = built.plant.arm, table.rows
    kp, kd, q0 = (np.tile(values, (rows, 1)) for values in ([50.0] * arm.n, [10.0] * arm.n, [0.1] * arm.n))
    for path, column in table.items():
        name, _, index = path.removeprefix("law.").removeprefix("run.").partition("[")
        if index:
            {"kp": kp, "kd": kd, "q0": q0}[name][:, int(index[:-1])] = column
    laws = [al.ComputedTorque(arm, built.law.motion, kp=p, kd=d) for p, d in zip(kp, kd, strict=True)]
    options = built.arguments | {"keep": "metrics", "threads": 1, "check_limits": False, "q0": q0}
    return partial(al.simulate_batch, built.plant, laws, **options)


def require_equal(what: str, ours: Any, theirs: Any) -> None:
    np.testing.assert_array_equal(ours, theirs, err_msg=f"bench_user_loops: {what}")


def sweeps(name: str, scenario: al.Scenario) -> Pair:
    run = partial(al.sweep, scenario, VARY, draws=RUNS, threads=1)
    table = run()
    batch = batch_of(scenario, table)
    for column, values in batch().metrics().columns().items():
        require_equal(f"sweep, {column}", table[column], values)
    return f"sweep, {name}", RUNS, "run", run, batch


def searches(name: str, scenario: al.Scenario) -> Pair:
    more = {"candidates": CANDIDATES, "generations": GENERATIONS, "tolerance": 0.0, "threads": 1}
    run = partial(al.tune, scenario, GAINS, "error_rms1", **more)
    found = run()
    rows = [slice(first, first + CANDIDATES) for first in range(0, found.runs, CANDIDATES)]
    batches = [batch_of(scenario, al.SweepTable({key: column[part] for key, column in found.tried.items()})) for part in rows]
    require_equal("tune", found.tried["cost"], np.concatenate([batch().metrics().columns()["error_rms1"] for batch in batches]))

    def loops() -> None:
        for batch in batches:
            batch().metrics()

    return f"tune, {name}", found.runs, "run", run, loops


def environments(name: str, plant: al.Plant, tau_max: Any) -> Pair:
    n = plant.arm.n
    wide = {"tau_max": tau_max, "q_limit": (-100.0, 100.0), "v_limit": 1e3, "horizon": 1e6}
    envs = ArmVectorEnv(ENVIRONMENTS, plant, **wide)
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-0.1, 0.1, (ENVIRONMENTS, n))
    states = envs._rows.states
    native = Stepper(plant, ENVIRONMENTS, envs._rows.dt, envs._rows.steps)
    native.reset(np.arange(ENVIRONMENTS), states.q, states.v)
    start = states.q.copy(), states.v.copy()
    envs.step(actions)
    native.step(actions * envs._rows.tau_max)
    require_equal("ArmVectorEnv", states.q, native.q)

    def twenty_steps(step: Callable[[], Any], of: Stepper) -> None:
        of.reset(np.arange(ENVIRONMENTS), *start)
        for _ in range(20):
            step()

    tau = actions * envs._rows.tau_max
    ours, theirs = partial(twenty_steps, partial(envs.step, actions), states), partial(twenty_steps, partial(native.step, tau), native)
    return f"ArmVectorEnv.step, {name}", 20 * ENVIRONMENTS, "environment", ours, theirs


def single_steps(name: str, scenario: al.Scenario, sampled: bool) -> Pair:
    built = scenario.build()
    given = {"dt": 1e-3, "check_limits": False} | ({"sample_time": 1e-3} if sampled else {})
    sim = al.Simulator(built.plant, built.law, built.arguments["q0"], **given)

    def steps() -> None:
        sim.reset()
        for _ in range(STEPS):
            sim.step()

    # The last step of a run ends exactly at its end, so that it may differ by rounding.
    options = given | {"monitors": False, "t_end": (STEPS + 0.5) * 1e-3}
    run = partial(al.simulate, built.plant, built.law, built.arguments["q0"], **options)
    steps()
    require_equal("Simulator", sim.q, run().q[STEPS])
    return f"Simulator.step, {'sampled, ' if sampled else ''}{name}", STEPS, "step", steps, run


def main() -> None:
    options = reporting.arguments("what a user calls beside the loops in it").parse_args()
    reporting.require_release("bench_user_loops")
    share = timing.busy()
    timing.pin([options.core])  # so that an environment uses one thread
    pairs: list[Pair] = []
    for name, arm in ARMS.items():
        plant = scenario_of(arm, 2 if name == "planar 2R" else 6).build().plant
        scenario = scenario_of(arm, plant.arm.n)
        tau_max = 2.0 * np.abs(plant.arm.gravity(np.full(plant.arm.n, 0.1))) + 5.0
        pairs += [sweeps(name, scenario), searches(name, scenario), environments(name, plant, tau_max)]
        pairs += [single_steps(name, scenario, sampled) for sampled in (False, True)]
    cases, verdicts = [], []
    for name, per, unit, ours, theirs in pairs:
        loops = Case("calls", f"{name}: loops", theirs, per)
        cases.append((unit, Case("calls", name, ours, per, against=loops.name), loops))
    timing.measure([case for _, *both in cases for case in both], options.rounds, options.core, lambda text: print(text, flush=True))
    lines = ["| call | unit | call, ns per unit | loops, ns per unit | ratio |", "|---|---|---:|---:|---:|"]
    for unit, ours, loops in cases:
        ratio = timing.ratio(ours, loops)
        lines.append(f"| {ours.name} | {unit} | {timing.digits(ours.median)} | {timing.digits(loops.median)} | {ratio:.2f} |")
        if not ours.name.startswith("Simulator"):
            verdicts.append((ours.name, f"at most {GOAL}", f"{ratio:.2f}", ratio <= GOAL))
    head = reporting.heading([case for _, *both in cases for case in both], share)
    reporting.finish("user_loops", "\n".join([head, "", *reporting.target_table(verdicts), "", *lines]), options.readme)


if __name__ == "__main__":
    main()
