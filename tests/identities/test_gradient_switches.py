"""Derivatives of runs whose state rates jump, at limits that stop an integral, dead zones, friction and walls: differences of runs."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

ONE = models.PENDULUM
TWO = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], inertias=[0.3, 0.2])
FLAT = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], inertias=[0.3, 0.2], gravity=(0.0, 0.0))
TIP: dict[str, Any] = {"frame": "link2", "axes": "xy", "integral_gain": [40.0, 30.0]}
REACH: dict[str, Any] = {"target": [0.3, 0.5], "stiffness": [60.0, 60.0], "damping": [12.0, 10.0]}
MOTORS: dict[str, Any] = {"joint_stiffness": [300.0, 200.0], "motor_inertia": [0.2, 0.1], "reduced_inertia": [0.1, 0.06]}
ELASTIC = al.ElasticArm(TWO, [300.0, 200.0], [0.2, 0.1])
BENT = np.array([0.1, 0.4])


def wave(amplitude: float) -> Any:
    return al.Sinusoid([1.0], [amplitude], [2.0], [0.3])


def limited(limit: float) -> Any:
    return al.PID(ONE, [2.0], kp=20.0, ki=10.0, kd=6.0, tau_max=limit)


def damped_wall(damping: float) -> Any:
    return al.RigidArm(FLAT, wall=al.Wall("link2", point=[0.75, 0.0, 0.0], normal=[-1.0, 0.0, 0.0], stiffness=300.0, damping=damping))


def case(plant: Any, law: Any, q0: Any, t_end: float, name: str, value: float, make: Callable[[float], Any], **more: Any) -> Any:
    """`make(value)` returns the law or the plant with another value of the number `name`."""
    return plant, law, np.array(q0), {"t_end": t_end, **more}, name, value, make


CASES: dict[str, Any] = {
    "PID": case(al.RigidArm(ONE), limited(6.0), [0.0], 6.0, "law.tau_max", 6.0, limited),
    "PID, moving target": case(
        al.RigidArm(ONE),
        al.PID(ONE, wave(1.2), kp=20.0, ki=10.0, kd=6.0, tau_max=7.0),
        [0.0],
        4.0,
        "law.target.amplitude",
        1.2,
        lambda x: al.PID(ONE, wave(x), kp=20.0, ki=10.0, kd=6.0, tau_max=7.0),
    ),
    "impedance, wrench": case(
        al.RigidArm(TWO),
        al.CartesianImpedance(TWO, **REACH, wrench_max=[6.0, 8.0], **TIP),
        BENT,
        3.0,
        "law.wrench_max",
        6.0,
        lambda x: al.CartesianImpedance(TWO, **REACH, wrench_max=[x, 8.0], **TIP),
    ),
    "impedance, torque": case(
        al.RigidArm(TWO),
        al.CartesianImpedance(TWO, **REACH, tau_max=[14.0, 8.0], **TIP),
        BENT,
        3.0,
        "law.tau_max",
        14.0,
        lambda x: al.CartesianImpedance(TWO, **REACH, tau_max=[x, 8.0], **TIP),
    ),
    "elastic impedance, wrench": case(
        ELASTIC,
        al.ElasticImpedance(TWO, **REACH, **MOTORS, wrench_max=[6.0, 8.0], **TIP),
        BENT,
        1.2,
        "law.wrench_max",
        6.0,
        lambda x: al.ElasticImpedance(TWO, **REACH, **MOTORS, wrench_max=[x, 8.0], **TIP),
    ),
    "elastic impedance, torque": case(
        ELASTIC,
        al.ElasticImpedance(TWO, **REACH, **MOTORS, tau_max=[14.0, 8.0], **TIP),
        BENT,
        1.2,
        "law.tau_max",
        14.0,
        lambda x: al.ElasticImpedance(TWO, **REACH, **MOTORS, tau_max=[x, 8.0], **TIP),
    ),
    "dead zone": case(
        al.RigidArm(TWO),
        al.Adaptive(TWO, al.Sinusoid([0.1, 0.0], [0.4, 0.3], [1.0, 2.0], [0.1, 0.3]), [8.0, 6.0], [3.0, 2.0], 0.3, dead_zone=0.3),
        [0.1, -0.2],
        1.62,
        "law.dead_zone",
        0.3,
        lambda x: al.Adaptive(TWO, al.Sinusoid([0.1, 0.0], [0.4, 0.3], [1.0, 2.0], [0.1, 0.3]), [8.0, 6.0], [3.0, 2.0], 0.3, dead_zone=x),
    ),
    "wall": case(
        damped_wall(20.0), al.PDGravity(FLAT, [0.2, 0.1], [8.0, 6.0], [1.0, 1.0]), [0.9, 0.9], 2.0, "plant.wall.damping", 20.0, damped_wall
    ),
    "saturation": case(
        al.RigidArm(TWO),
        al.PDGravity(TWO, [0.9, 0.8], [30.0, 20.0], [6.0, 5.0]),
        [0.1, -0.2],
        3.0,
        "law.kp",
        30.0,
        lambda x: al.PDGravity(TWO, [0.9, 0.8], [x, 20.0], [6.0, 5.0]),
        tau_max=[40.0, 15.0],
    ),
}
METHODS: dict[str, dict[str, Any]] = {
    "dop853": {"rtol": 1e-10, "atol": 1e-12},
    "dopri5": {"rtol": 1e-10, "atol": 1e-12},
    "rk4": {"dt": 5e-4},
    "semi_implicit": {"dt": 2.5e-4},
}


def rates(run: Any, name: str) -> Any:
    return run.sensitivity[name]


def series(run: Any) -> Array:
    return np.hstack([run.q, run.v, run.estimate]) if run.estimate is not None else np.hstack([run.q, run.v])


def loop(case: Any, value: float) -> tuple[Any, Any]:
    plant, law, _, _, name, _, make = case
    return (plant, make(value)) if name.startswith("law.") else (make(value), law)


@pytest.fixture(scope="module", params=list(CASES))
def compared(request: Any) -> tuple[str, Array, Array]:
    """The name of a case, its times, and the differences of two tight runs."""
    one = CASES[request.param]
    _, _, q0, options, _, value, _ = one
    t = np.linspace(0.0, options["t_end"], 25)
    h = 1e-4
    runs = [al.simulate(*loop(one, value + s), q0, method="dop853", rtol=1e-12, atol=1e-13, t_eval=t, **options) for s in (h, -h)]
    return request.param, t, (series(runs[0]) - series(runs[1])) / (2.0 * h)


@pytest.mark.parametrize("method", list(METHODS))
def test_a_switch_moves_with_the_parameters(compared: tuple[str, Array, Array], method: Any) -> None:
    which, t, difference = compared
    plant, law, q0, options, name, _, _ = CASES[which]
    arguments = {"method": method, "t_eval": t, **METHODS[method], **options}
    run = al.simulate(plant, law, q0, sensitivity=name, **arguments)
    tangents = rates(run, name)
    found = series(tangents)[:, :, 0]
    # Adaptive steps: at the limit of `impedance`, the state slides in steps whose size is that of the tolerance of the state. Fixed steps
    # pass over a switch with an error of the order of the step, 5e-4 s, times rates up to 30/s. Where the rate of a margin is small,
    # the first-order method needs smaller steps for this.
    error = np.abs(found - difference).max(axis=0) / np.abs(difference).max(axis=0).clip(1e-2)
    assert error.max() < (2e-3 if "rtol" in arguments else 2e-2), error
    weights = {"q": np.zeros_like(run.q), "tau": np.zeros_like(run.tau)}
    weights["q"][-1], weights["tau"][12] = 1.0, 0.5
    _, slopes = al.gradient(lambda run: (0.0, weights), plant, law, q0, name, **arguments)
    expected = (tangents.q[-1].sum(axis=0) + 0.5 * tangents.tau[12].sum(axis=0))[0]
    # The adjoint and the tangents have the same terms in another order.
    assert slopes[name].ravel()[0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("method", ["rk4", "semi_implicit", "euler"])
def test_a_joint_stops_by_friction(method: Any) -> None:
    """A free joint with friction f and inertia I stops at q = v0^2 I / (2 f), and stays there."""
    arm = al.pendulum(2.0, 0.0).with_drives(friction=[0.8])
    free = al.PDGravity(arm, [0.0], 1e-12, 1e-12)
    run = al.simulate(
        al.RigidArm(arm, friction=True), free, [0.0], v0=[0.4], t_end=2.0, dt=1e-3, method=method, sensitivity=["v0", "arm.friction"]
    )
    end = {name: rates(run, name).q[-1, 0, 0] for name in ("v0", "arm.friction")}
    # The first-order methods stop within one step of the exact time, which is a relative error of 1e-3.
    assert end["v0"] == pytest.approx(0.4 * 2.0 / 0.8, rel=4e-3)
    assert end["arm.friction"] == pytest.approx(-(0.4**2) * 2.0 / (2.0 * 0.8**2), rel=4e-3)
    assert np.abs(rates(run, "v0").v[-1]).max() < 1e-3


def test_a_switch_that_steps_do_not_resolve_is_refused() -> None:
    """Later, the error of the dead zone swings about the edge of the zone faster than steps of 1 ms resolve."""
    plant, law, q0, options, name, *_ = CASES["dead zone"]
    with pytest.raises(al.SolveError, match="grazed") as caught:
        al.simulate(plant, law, q0, sensitivity=name, method="rk4", dt=1e-3, **{**options, "t_end": 4.0})
    assert caught.value.status is al.Status.DEGRADED


def test_rows_of_a_batch_have_their_own_switches() -> None:
    laws = [limited(limit) for limit in (5.5, 6.0, 7.0)]
    options: dict[str, Any] = {"t_end": 3.0, "dt": 1e-3, "record_every": 500}
    batch = al.simulate_batch(al.RigidArm(ONE), laws, np.zeros((3, 1)), sensitivity="law.tau_max", **options)
    for row, law in enumerate(laws):
        run = al.simulate(al.RigidArm(ONE), law, [0.0], sensitivity="law.tau_max", **options)
        np.testing.assert_array_equal(rates(batch, "law.tau_max").q[row], rates(run, "law.tau_max").q)
