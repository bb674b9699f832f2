"""The options of runs and of what is computed from runs, for the walk over optional arguments."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from options_of_laws import ARM, K_J, Q2, Q3, REAL, THREE, V2, V3, B
from walked_options import Case

import armlet as al

PD = al.PDGravity(REAL, [0.5, 0.7, -0.5], 8.0, 5.0)
TASK = al.PriorityVelocity(THREE, [al.Task("link3", "x", [0.6], 2.0)])
CARTESIAN = al.CartesianImpedance(THREE, [0.7, 0.5], 300.0, 40.0, frame="link3", axes="xy")
STATE = al.StateFeedback(ARM, [0.5, 0.2], 200.0, 20.0, 1.0, 0.02, K_J)
#: Length of the runs of each loop, s.
LENGTH = {"velocity": 2.0}
FORCE = [(0.0, [5.0, 3.0, 0.0]), (0.02, [0.0, 3.0, 0.0])]
#: Each loop: plant, law, start, and its values of options.
LOOPS: dict[str, tuple[al.Plant, Any, Any, dict[str, Any]]] = {
    "rigid": (al.RigidArm(REAL), PD, Q3, {"v0": V3, "force": FORCE, "tau_max": 3.0, "force_frame": "link2"}),
    "impedance": (al.RigidArm(THREE), CARTESIAN, Q3, {"v0": V3, "force": [5.0, 3.0], "tau_max": 20.0, "force_frame": "link2"}),
    "velocity": (al.VelocityArm(THREE), TASK, Q3, {"v0": V3, "force": FORCE, "tau_max": 0.003, "force_frame": "link2"}),
    "elastic": (
        al.ElasticArm(ARM, K_J, B),
        STATE,
        Q2,
        {"v0": V2, "force": FORCE, "tau_max": 20.0, "force_frame": "link2", "theta0": [0.31, 0.91], "theta_dot0": [0.5, 0.3]},
    ),
}
RIGID_ONLY = {"theta0": [0.31, 0.91, 0.2], "theta_dot0": [0.5, 0.3, 0.2]}
FIXED = {"method": "euler", "sample_time": 2e-3, "record_every": 3, "t_eval": [0.01, 0.02], "monitors": False}
ADAPTIVE = {"rtol": 1e-3, "atol": 1e-2, "events": [al.Event.joint(0, 0.3001)], "dense": True, "sensitivity": "q0", "max_step": 1e-3}
COMMON = {"dt": 2e-3}


def simulate(loop: str, method: str, **options: Any) -> Any:
    plant, law, q0, _ = LOOPS[loop]
    fixed = {} if "dt" in options or method == "dop853" else {"dt": 1e-3}
    run = al.simulate(plant, law, q0, throw=False, **({"method": method, "t_end": LENGTH.get(loop, 0.04)} | fixed | options))
    return [run, run.sample(0.01) if "dense" in options else None]


def simulate_batch(loop: str, method: str, **options: Any) -> Any:
    plant, law, q0, _ = LOOPS[loop]
    fixed: dict[str, Any] = {} if "dt" in options else {"dt": 1e-3} if method != "dop853" else {"t_eval": [0.01, 0.04]}
    rows = {name: [options.pop(name)] * 2 for name in ("v0", "theta0", "theta_dot0") if name in options}
    if "force" in options and isinstance(options["force"][0], tuple):
        rows["force"] = [options.pop("force")] * 2
    elif "force" in options:
        rows["force"] = [options.pop("force")] * 2
    batch = al.simulate_batch(plant, law, [q0, q0], **({"method": method, "t_end": LENGTH.get(loop, 0.04)} | fixed | options | rows))
    return batch, batch.metrics() if options.get("keep") != "final" else None


def simulator(loop: str, method: str, **options: Any) -> Any:
    plant, law, q0, _ = LOOPS[loop]
    simulator = al.Simulator(plant, law, q0, **({"method": method} | ({} if "dt" in options else {"dt": 1e-3}) | options))
    found = []
    for _ in range(3):
        simulator.step()
        found += [simulator.q, simulator.v, simulator.t]
    return found


def sampling(loop: str, **options: Any) -> Any:
    return simulate(loop, "rk4", sample_time=al.Sampling(4e-3, **options))


def loop_program(loop: str, method: str, **options: Any) -> Any:
    plant, law, _, _ = LOOPS[loop]
    return str(al.loop_program(plant, law, **({"method": method} | options)))


def of(loop: str, *without: str) -> dict[str, Any]:
    own = LOOPS[loop][3]
    zeros = {} if loop == "elastic" else RIGID_ONLY
    return {name: value for name, value in (FIXED | ADAPTIVE | COMMON | zeros | own).items() if name not in without}


SLACK = {
    "*tol+*": "a loose tolerance, or steps that end at each sample",
    "*+*tol": "a loose tolerance, or steps that end at each sample",
    "*+tau_max": "the input is below its limit in one of both runs",
    "tau_max+*": "the input is below its limit in one of both runs",
    "metrics+keep": "the settling time is unknown for a law without a reference of the joints",
}
CASES: dict[str, Case] = {}
for loop in LOOPS:
    for method in ("rk4", "dop853"):
        CASES[f"simulate {loop} {method}"] = Case(
            partial(simulate, loop, method), of(loop, "method", "rtol", "atol") | ({"rtol": 1e-3, "atol": 1e-2}), SLACK
        )
        CASES[f"simulate_batch {loop} {method}"] = Case(
            partial(simulate_batch, loop, method),
            of(loop, "method", "events", "dense") | {"keep": "metrics", "metrics": {"band": 1e3}},
            SLACK,
        )
    CASES[f"simulate_batch {loop} final"] = Case(
        partial(simulate_batch, loop, "rk4", keep="final"),
        of(loop, "method", "events", "dense", "rtol", "atol"),
        SLACK | dict.fromkeys(("record_every", "t_eval"), "only the last state is kept, for any records"),
    )
    CASES[f"Sampling {loop}"] = Case(
        partial(sampling, loop),
        {"delay": 1e-3, "jitter": 2e-3, "sensor_delay": 1, "rate_limit": 2.0 if loop == "velocity" else 2e3, "seed": 3}
        | {"torque_sensor": al.TorqueSensor(bias=0.3), "noise": {"q": 0.01}, "resolution": {"q": 0.01}},
        {"seed": "a scenario states its seed before it has noise"},
    )
    for quantity in ("v", "theta", "theta_dot"):
        CASES[f"Sampling {loop} {quantity}"] = Case(partial(sampling, loop), {"noise": {quantity: 0.01}, "resolution": {quantity: 0.03}})
    CASES[f"Simulator {loop}"] = Case(
        partial(simulator, loop, "rk4"),
        of(loop, *ADAPTIVE, "method", "monitors", "record_every", "t_eval"),
        SLACK | {"force_frame": "the frame of `Simulator.step(force=)`"},
    )
CASES["TorqueSensor"] = Case(
    lambda **o: simulate("elastic", "rk4", sample_time=al.Sampling(4e-3, torque_sensor=al.TorqueSensor(**o))),
    {"noise": 0.1, "bias": 0.2, "resolution": 0.5, "bandwidth": 20.0},
)


RUN, _ = simulate("impedance", "rk4")
MEASURED = al.Run({"t": RUN.t, "q": RUN.q + 1e-4 * np.sin(40.0 * RUN.t)[:, None], "v": RUN.v})


def metrics(**options: Any) -> Any:
    plant, law, q0, _ = LOOPS["elastic"]
    return al.metrics(al.simulate(plant, law, q0, t_end=2.0, dt=1e-3, record_every=10), **options)


def equilibrium(**options: Any) -> Any:
    law = al.ElasticImpedance(ARM, [0.4, 0.5], 300.0, 40.0, K_J, B, 0.02, frame="link2", axes="xy")
    return al.equilibrium(al.ElasticArm(ARM, K_J, B), law, q0=Q2, **options)


def elastic_limits(**options: Any) -> Any:
    law = al.ElasticImpedance(ARM, [0.4, 0.5], 300.0, 40.0, K_J, B, 0.02, frame="link2", axes="xy")
    return al.elastic_limits(al.ElasticArm(ARM, K_J, B), law, q0=Q2, **options)


def to_control(law: Any = None, **options: Any) -> Any:
    system = al.to_control(al.RigidArm(THREE), law, **({"x0": Q3} | options))
    return [system.A, system.B, system.C]


def loop_margins(law: Any, **options: Any) -> Any:
    found = al.loop_margins(al.RigidArm(THREE), law, Q3, **options)
    return [found.phase, found.delay, found.disc]


def identify(**options: Any) -> Any:
    return al.identify_from_runs(
        MEASURED, ["v0", "q0", "law.stiffness"], **({"plant": al.RigidArm(THREE), "law": CARTESIAN, "dt": 1e-3} | options)
    )


CASES |= {
    "metrics": Case(
        metrics,
        {"reference": [0.1, 0.2], "band": 0.6, "settle": 0.5, "tolerance": 1e3, "frame": "link2"},
        {"settle+reference": "no joint settles"},
    ),
    "equilibrium": Case(equilibrium, {"force": [5.0, 3.0], "force_frame": "link1"}),
    "elastic_limits": Case(elastic_limits, {"force": [5.0, 3.0], "force_frame": "link1", "sample_time": 1e-3, "sensor_bandwidth": 100.0}),
    "to_control": Case(to_control, {"u0": [0.3, 0.2, 0.1], "t": 0.3, "sample_time": 0.01}),
    "loop_margins": Case(
        partial(loop_margins, al.ComputedTorque(THREE, al.Sinusoid(Q3, 0.4, 3.0, 0.3), 30.0, 10.0)), {"t": 0.3, "sample_time": 0.01}
    ),
    "to_control law": Case(
        partial(to_control, al.ComputedTorque(THREE, al.Sinusoid(Q3, 0.4, 3.0, 0.3), 30.0, 10.0)),
        {"u0": [0.3, 0.2, 0.1], "t": 0.3, "sample_time": 0.01},
    ),
    "to_control nonlinear": Case(
        lambda **o: str(al.to_control(al.RigidArm(THREE), **o)), {"u0": [0.3, 0.2, 0.1], "t": 0.3, "sample_time": 0.01}
    ),
    "identify_from_runs": Case(
        identify, {"noise": {"q": 1e-3, "v": [1.0, 2.0, 3.0]}, "iterations": 1, "tolerance": 0.5}, {"tolerance+iterations": "one step"}
    ),
}
