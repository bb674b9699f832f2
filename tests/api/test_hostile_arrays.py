"""Objects similar to arrays: masked, endless, with impossible lengths, not exact in float64.

Each is refused quickly, with an error that names the argument.
"""

from __future__ import annotations

import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from pr_loops import ARM, LAW, PLANT, adaptive, batch, run

import armlet as al
from armlet.figures import time_path
from armlet.gym import ArmEnv, ArmVectorEnv, Reach

CHAIN = al.planar_arm([1.0, 1.0])
TIP = al.Task("link2", "xy")
ELASTIC = al.ElasticArm(CHAIN, [100.0, 100.0], [0.1, 0.1])
Q, J, V = [0.1, 0.2], [[1.0, 0.0]], [1.0]
WAYPOINTS = [[0.0, 0.0], [0.5, 0.5], [1.0, 0.0]]


def still(t: float, y: Any) -> Any:
    return y


def pushed(force: Any) -> al.Run:
    law = al.PDGravity(CHAIN, Q, 1.0, 1.0)
    return al.simulate(al.RigidArm(CHAIN), law, Q, t_end=0.01, dt=1e-3, force=force, force_frame="link2")


def environment() -> ArmEnv:
    env = ArmEnv()
    env.reset(seed=0)
    return env


# The scenario of the sweeps below.
SCENARIO = al.Scenario(
    {
        "arm": {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5},
        "motion": {"kind": "Hold", "q": [1.0, 0.0]},
        "law": {"kind": "ComputedTorque", "kp": 100.0, "kd": 20.0},
        "run": {"q0": [0.0, 0.0], "t_end": 0.002, "dt": 1e-3},
    }
)
# Calls with a hostile argument `x`, by name. Most of these arguments are arrays or lists, and some are single numbers.
ENTRIES: dict[str, Callable[[Any], Any]] = {
    "mass_matrix": lambda x: ARM.mass_matrix(x),
    "bias": lambda x: ARM.bias(Q, x),
    "jacobian": lambda x: CHAIN.jacobian(x, "link2"),
    "derivatives": lambda x: CHAIN.inverse_dynamics_derivatives(x, Q, Q),
    "planar_arm": lambda x: al.planar_arm(x),
    "from_dh": lambda x: al.Arm.from_dh([x]),
    "with_payload": lambda x: CHAIN.with_payload("link2", 1.0, x),
    "with_parameters": lambda x: CHAIN.with_parameters(x),
    "Hold": lambda x: al.Hold(x),
    "Quintic": lambda x: al.Quintic([0.0, 0.0], x, 1.0),
    "Sinusoid": lambda x: al.Sinusoid([0.0, 0.0], x, 1.0, 0.0),
    "Table": lambda x: al.Table(0.1, x, WAYPOINTS, WAYPOINTS),
    "gain": lambda x: adaptive(kp=x),
    "estimate": lambda x: adaptive(estimate=x),
    "projection": lambda x: adaptive(projection=x),
    "law": lambda x: LAW(0.0, Q, x),
    "ElasticArm": lambda x: al.ElasticArm(CHAIN, x, [0.1, 0.1]),
    "q0": lambda x: run(q0=x),
    "v0": lambda x: run(v0=x),
    "dt": lambda x: run(dt=x),
    "t_eval": lambda x: run(t_eval=x),
    "tau_max": lambda x: run(tau_max=x),
    "force": lambda x: pushed(x),
    "batch": lambda x: batch(q0=x),
    "Simulator.step": lambda x: al.Simulator(al.RigidArm(CHAIN), q0=Q, dt=1e-3).step(x),
    "jacobians": lambda x: al.solve_priority([x], [V]),
    "velocities": lambda x: al.solve_priority([J], [x]),
    "levels": lambda x: al.solve_priority(x, [V]),
    "PrioritySolver.solve": lambda x: al.PrioritySolver(2, [1]).solve([x], [V]),
    "PrioritySolver rows": lambda x: al.PrioritySolver(2, x),
    "for_arm": lambda x: al.PrioritySolver.for_arm(CHAIN, [TIP]).solve(x, [Q]),
    "diagnose_priority": lambda x: al.diagnose_priority([x]),
    "velocity_bounds": lambda x: al.velocity_bounds(x, [-1.0, -1.0], [1.0, 1.0], [1.0, 1.0], 0.1),
    "Task target": lambda x: al.Task("link2", "xy", x, 1.0),
    "Task gain": lambda x: al.Task("link2", "xy", Q, x),
    "tasks": lambda x: al.PriorityVelocity(CHAIN, x),
    "thresholds of tasks": lambda x: al.PriorityVelocity(CHAIN, [al.Task("link2", "xy", [0.5, 0.5])], eps=x),
    "sweep settle": lambda x: al.sweep(SCENARIO, {"law.kp": [1.0]}, settle=x),
    "sweep band": lambda x: al.sweep(SCENARIO, {"law.kp": [1.0]}, band=x),
    "inverse_kinematics": lambda x: al.inverse_kinematics(CHAIN, [al.Task("link2", "xy", Q)], x),
    "bang_bang_time": lambda x: al.bang_bang_time(0.0, x, 1.0, 1.0, 1.0),
    "torque_optimal_time": lambda x: al.torque_optimal_time(0.0, x, 1.0, 1.0, 1.0),
    "BangBangBatch": lambda x: al.bang_bang_time(0.0, [1.0, 2.0], 1.0, 1.0, 3.0)[x],
    "path": lambda x: al.time_path(CHAIN, x, tau_max=10.0),
    "path stops": lambda x: al.time_path(CHAIN, WAYPOINTS, tau_max=100.0, stops=x),
    "path limits": lambda x: al.time_path(CHAIN, WAYPOINTS, tau_max=10.0, v_max=x),
    "path times": lambda x: al.time_path(CHAIN, WAYPOINTS, tau_max=100.0)(x),
    "identify": lambda x: CHAIN.identify(x, x, x, x),
    "project_parameters": lambda x: al.project_parameters(x),
    "elastic_limits": lambda x: al.elastic_limits(x, 1.0, 1.0),
    "damping_from_ratio": lambda x: al.damping_from_ratio(x, [[1.0]], 0.7),
    "equilibrium": lambda x: al.equilibrium(PLANT, al.PDGravity(ARM, Q, 1.0, 1.0), None, q0=x),
    "stops": lambda x: al.RigidArm(CHAIN, stops=al.JointStops(1.0, lower=x)),
    "events": lambda x: run(events=x),
    "integrate": lambda x: al.integrate(still, (0.0, 1.0), x, method="rk4", dt=0.1),
    "integrate atol": lambda x: al.integrate(still, (0.0, 1.0), Q, method="dopri5", atol=x),
    "DenseOutput": lambda x: al.integrate(still, (0.0, 1.0), Q, dense_output=True).dense(x),  # type: ignore[misc]
    "metrics reference": lambda x: al.metrics(batch(), reference=x),
    "metrics band": lambda x: al.metrics(batch(), band=x),
    "pieces q0": lambda x: batch(q0=x, keep="metrics"),
    "pieces v0": lambda x: batch(v0=x, keep="metrics"),
    "forces of runs": lambda x: batch(force=x, keep="metrics"),
    "to_control x0": lambda x: al.to_control(al.RigidArm(CHAIN), None, x),
    "to_control u0": lambda x: al.to_control(al.RigidArm(CHAIN), None, Q, u0=x),
    "point_to_point": lambda x: al.point_to_point(x, Q, 1.0, 1.0, 1.0),
    "point_to_point limits": lambda x: al.point_to_point(Q, V * 2, x, 1.0, 1.0),
    "gym action": lambda x: environment().step(x),
    "gym limits": lambda x: ArmEnv(tau_max=x),
    "gym range": lambda x: ArmEnv(q_limit=(x, 1.0)),
    "gym task": lambda x: ArmEnv(task=Reach(axes="xy", q0=x)),
    "path figure": lambda x: time_path._bounds(x, 2),
    "Run": lambda x: al.Run({"t": [0.0, 1.0], "q": x, "v": x}),
    "sensor": lambda x: al.TorqueSensor(bias=x),
    "integrate f": lambda x: al.integrate(lambda t, y: x, (0.0, 1.0), Q, method="rk4", dt=0.1),
}


class Endless:
    """A sequence with endless entries and no length."""

    def __getitem__(self, i: int) -> float:
        return 0.5


class Longer(Endless):
    """A sequence with endless entries and the length two."""

    def __len__(self) -> int:
        return 2


class Vast(Endless):
    """A sequence with the largest possible length."""

    def __len__(self) -> int:
        return 2**62


class Negative(Endless):
    def __len__(self) -> int:
        return -1


class Beyond(Endless):
    def __len__(self) -> int:
        return 2**64


def endless() -> Iterator[float]:
    while True:
        yield 0.5


HOSTILE: dict[str, Callable[[], Any]] = {
    "masked": lambda: np.ma.MaskedArray([0.1, 0.2], [False, True]),
    "masked rows": lambda: np.ma.MaskedArray([[0.1, 0.2]], [[False, True]]),
    "masked, nothing masked": lambda: np.ma.MaskedArray([0.1, 0.2]),
    "masked integers": lambda: np.ma.MaskedArray([1, 2], [False, True]),
    "masked in a list": lambda: [np.ma.masked, 0.1],
    "masked number": lambda: np.ma.masked,
    "booleans": lambda: [True, False],
    "boolean among numbers": lambda: [0.1, True],
    "numpy booleans": lambda: [np.True_, 0.1],
    "integers between numbers": lambda: [2**53 + 1, 0],
    "int64 between numbers": lambda: np.array([0, -(2**53) - 1]),
    "uint64 between numbers": lambda: np.array([0, 2**63 + 1], np.uint64),
    "integer between numbers": lambda: 2**60 + 1,
    "endless": Endless,
    "iterator without end": endless,
    "vast": Vast,
    "negative length": Negative,
    "length beyond": Beyond,
    "vast range": lambda: range(10**15),
    "nested": lambda: nested(40),
    "wrong shape, seen at once": lambda: np.broadcast_to(1e-3, (7, 2 * 10**8)),
    "complex": lambda: [1.0 + 0.0j, 0.0],
    "text": lambda: "0.1",
    "bytes": lambda: b"ab",
}

# Pairs (kind of array, argument) that armlet accepts. The test skips them.
MEANT = {
    # These functions accept arrays of any shape, as arrays of problems or of times.
    *(
        ("wrong shape, seen at once", entry)
        for entry in ("bang_bang_time", "torque_optimal_time", "path times", "elastic_limits", "Table", "Run")
    ),
}


def nested(depth: int) -> Any:
    value: Any = 0.5
    for _ in range(depth):
        value = [value]
    return value


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_arguments_are_refused_at_once(name: str) -> None:
    accepted = []
    for entry, call in ENTRIES.items():
        if (name, entry) in MEANT:
            continue
        tracemalloc.start()
        try:
            call(HOSTILE[name]())
        except (al.InputError, TypeError, IndexError, MemoryError) as error:
            assert type(error) in (al.InputError, TypeError, IndexError), (entry, error)
        else:
            accepted.append(entry)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < 100e6, (entry, peak)
    assert accepted == []


def test_only_as_many_entries_are_read_as_the_length() -> None:
    """If the length is two, exactly two entries are read, although the entries are endless."""
    np.testing.assert_array_equal(ARM.mass_matrix(Longer()), ARM.mass_matrix([0.5, 0.5]))


@pytest.mark.parametrize("many", [Endless, endless, lambda: range(10**9)])
def test_sequences_of_anything_end(many: Callable[[], Any]) -> None:
    """Arguments that are not arrays of numbers and are read entry by entry. The read must end."""
    with pytest.raises(al.InputError, match="integrate: args is too long"):
        al.integrate(lambda t, y: -y, (0.0, 1.0), Q, args=many())
    with pytest.raises(al.InputError, match=r"ArmVectorEnv\.reset: seed is too long"):
        ArmVectorEnv(2).reset(seed=many())


def test_integers_that_float64_represents_are_taken() -> None:
    huge = 2**53 + 2
    np.testing.assert_array_equal(al.Hold([huge, -huge])(0.0)[0], [float(huge), -float(huge)])
    np.testing.assert_array_equal(al.Hold([10**20, 2**63])(0.0)[0], [1e20, 2.0**63])
    np.testing.assert_array_equal(al.Hold(np.array([huge, 2**63], np.uint64))(0.0)[0], [float(huge), 2.0**63])


def test_the_first_bad_index_is_named() -> None:
    with pytest.raises(al.InputError, match=r"mass_matrix: q is not exact in float64.*9007199254740993 \(first bad index \(1, 0\)\)"):
        ARM.mass_matrix(np.array([[0, 0], [2**53 + 1, 0]]))
    with pytest.raises(al.InputError, match=r"mass_matrix: q is not an array of real numbers: .* got bool \(first bad index \(1, 1\)\)"):
        ARM.mass_matrix([[0.0, 0.0], [0.0, True]])


def test_a_masked_out_is_refused() -> None:
    with pytest.raises(al.InputError, match="bias: out is a masked array"):
        ARM.bias(Q, Q, out=np.ma.MaskedArray(np.zeros(2)))


INTERRUPTED = """
import signal, time
import armlet as al

arm = al.planar_pr(2.0, 0.5, 0.5)
big = [[0.0, 0.0]] * 2_000_000

class Late(Exception): pass
def stop(*args): raise Late(time.perf_counter())
signal.signal(signal.SIGALRM, stop)
signal.setitimer(signal.ITIMER_REAL, 0.2)
asked = time.perf_counter() + 0.2
try:
    while True: arm.gravity(big)
except Late as late:
    print(time.perf_counter() - asked)
"""


def test_signals_are_answered_while_a_list_is_read() -> None:
    output = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, check=True, timeout=120).stdout
    # The limit in seconds. A debug build takes several times as long to read a list of two million rows.
    assert float(output) < 1.0
