"""`loop_margins` against the eigenvalues of loops with a changed input, and sampled systems against simulated steps."""

from __future__ import annotations

from typing import Any

import control
import models
import numpy as np
import pytest

import armlet as al
from armlet.linear_loop import LinearLoop
from armlet.reference import loop_margins as ref

ARM = models.TWO_HEAVY_LINKS
HOLD = np.array([0.3, 1.0])
STIFF, MOTORS = [[800.0, 50.0], [50.0, 500.0]], [0.4, 0.3]
TIP: dict[str, Any] = {"frame": "link2", "axes": "xy"}
TARGET = ARM.position(HOLD, "link2")[:2]
FILTERED: dict[str, Any] = {"derivative_filter": 300.0, "observer_bandwidth": 20.0}
NAMES = ("PD", "PID with filter and observer", "motors", "reduced motors", "velocity")


def loop(name: str, arm: al.Arm = ARM) -> tuple[al.Plant, al.Law]:
    rigid, elastic = al.RigidArm(arm), al.ElasticArm(arm, STIFF, MOTORS)
    if name == "PD":
        return rigid, al.PDGravity(arm, HOLD, [150.0, 60.0], [30.0, 8.0])
    if name == "motors":
        return elastic, al.MotorPD(arm, HOLD, 400.0, 20.0, STIFF)
    if name == "reduced motors":
        return elastic, al.ElasticImpedance(arm, TARGET, 300.0, 40.0, STIFF, MOTORS, 0.1, **TIP, integral_gain=200.0)
    if name == "velocity":
        return al.VelocityArm(arm), al.PriorityVelocity(arm, [al.Task("link2", "xy", TARGET, 5.0)])
    return rigid, al.PID(arm, HOLD, 80.0, 60.0, 15.0, **FILTERED)


CLOCKS: dict[str, Any] = {
    "continuous": None,
    "sampled": 2e-3,
    "delay": al.Sampling(2e-3, delay=4e-3),
    "part of a period": al.Sampling(2e-3, delay=3e-3),
    "old measurements": al.Sampling(2e-3, delay=2e-3, sensor_delay=2),
}


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("name", NAMES)
def test_margins(name: str, clock: str) -> None:
    plant, law = loop(name)
    margins = al.loop_margins(plant, law, HOLD, t=0.0, sample_time=CLOCKS[clock])
    assert isinstance(margins, al.LoopMargins)
    A, B, C = margins._matrices
    for w in (0.7, 40.0, 900.0):
        wanted_gain = ref.loop_gain(A, B, C, w, margins._period)
        np.testing.assert_allclose(margins.loop_gain(w), wanted_gain, rtol=0.0, atol=1e-8 * np.abs(wanted_gain).max())
    if not margins.stable:
        assert not ref.is_stable(A + B @ C, clock != "continuous")
        return
    # Every case takes one of the two joints, because the search of the reference takes a second.
    for i in [(NAMES.index(name) + list(CLOCKS).index(clock)) % 2]:
        wanted = ref.loop_margins(A, B, C, i, sampled=clock != "continuous")
        for key, value in wanted.items():
            got = float(np.clip(getattr(margins, key)[i], 1e-4, 1e4)) if key.startswith("gain") else float(getattr(margins, key)[i])
            # The directions of d have steps of one degree: the border is at most 1.5e-4 of the disc margin farther away.
            tolerance = 2e-3 if key == "disc" else 1e-6
            assert got == pytest.approx(min(value, 2.0) if key == "disc" else value, rel=tolerance, abs=1e-7), (key, i)
        if clock != "continuous" and np.isfinite(margins.delay[i]):
            whole = margins.delay[i] / margins._period
            assert ref.is_stable(ref.delayed(A, B, C, i, int(np.floor(whole))), True)
            assert not ref.is_stable(ref.delayed(A, B, C, i, int(np.ceil(whole))), True)
    assert margins.disc_all <= margins.disc.min() * (1.0 + 1e-9)


@pytest.mark.parametrize("clock", [clock for clock in CLOCKS if clock != "continuous"])
@pytest.mark.parametrize("name", NAMES)
def test_the_sampled_system_is_the_simulated_one(name: str, clock: str) -> None:
    """At a distance of 1e-6 from the equilibrium, terms of second order are below 1e-5 of the deviation.

    Before the first output acts, the input is zero. So the arm has no gravity in a loop with a delay, and rests without input.
    """
    sampling = CLOCKS[clock] if isinstance(CLOCKS[clock], al.Sampling) else al.Sampling(CLOCKS[clock])
    light = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], gravity=(0.0, 0.0))
    plant, law = loop(name, light if sampling.delay + sampling.sensor_delay else ARM)
    linear = LinearLoop("test", plant, law)
    rest, m, count = linear.state(HOLD), linear.m, 12
    options: dict[str, Any] = {"t_end": count * sampling.period, "dt": 2.5e-4, "record_every": 8, "check_limits": False}
    if isinstance(plant, al.ElasticArm):
        options["theta0"] = rest[4:6]

    def states(q0: Any) -> Any:
        run = al.simulate(plant, law, q0, sample_time=sampling, **options)
        parts = [getattr(run, key) for key in ("q", "v", "theta", "theta_dot", "estimate")]
        return np.concatenate([x for x in parts if x is not None], axis=1)

    moved = (states(HOLD + 1e-6 * np.array([1.0, -2.0])) - states(HOLD))[:, : len(rest)]
    system = al.to_control(plant, law, HOLD, sample_time=sampling)
    # The measurements before the start are those of the start.
    past = np.zeros(system.nstates - len(rest) - sampling.sensor_delay * m)
    x = np.concatenate([moved[0], past, np.tile(moved[0][:m], sampling.sensor_delay)])
    for k in range(count):
        np.testing.assert_allclose(x[: len(rest)], moved[k], rtol=0.0, atol=1e-4 * np.abs(moved[: k + 1]).max(), err_msg=f"sample {k}")
        x = system.A @ x
    assert system.dt == sampling.period


def test_an_arm_alone_is_discretised_as_by_python_control() -> None:
    plant = al.RigidArm(ARM)
    linear = al.to_control(plant, x0=HOLD)
    for period in (1e-3, 0.05):
        theirs, ours = control.sample_system(linear, period, "zoh"), al.to_control(plant, x0=HOLD, sample_time=period)
        for key in "ABCD":
            np.testing.assert_allclose(getattr(ours, key), getattr(theirs, key), rtol=1e-11, atol=1e-14)
