"""The options of PID: consequences of their equations for loops of a mass and of arms, sampled and continuous."""

from __future__ import annotations

from typing import Any

import control
import models
import numpy as np
import pytest

import armlet as al

T, MASS = 2e-3, 1.5


def mass(gravity: float = 0.0) -> al.Arm:
    """An arm with one prismatic joint along x."""
    return al.Arm.from_chain([{"type": "P", "axis": [1.0, 0.0, 0.0], "phi": [MASS] + 9 * [0.0]}], gravity=[-gravity, 0.0, 0.0])


def positions(motion: al.Motion, times: Any) -> Any:
    return np.array([motion(t)[0] for t in times])


@pytest.mark.parametrize("observer", [None, 40.0])
@pytest.mark.parametrize("rate", [None, 150.0])
@pytest.mark.parametrize("ki", [None, 90.0])
def test_a_sampled_loop_is_its_transfer_function(ki: float | None, rate: float | None, observer: float | None) -> None:
    """A sampled loop of a mass without gravity equals its transfer function.

    The states of the law are integrated by forward differences. The motion of the mass under a held force is exact.
    """
    kp, kd, m = 120.0, 24.0, 1.1
    inertia = None if observer is None else m
    law = al.PID(mass(), [0.2], kp, ki, kd, derivative_filter=rate, observer_bandwidth=observer, nominal_inertia=inertia)
    run = al.simulate(al.RigidArm(mass()), law, [0.0], t_end=0.8, dt=T, sample_time=T)

    def block(up: list[float], down: list[float], name: str, to: str) -> Any:
        return control.ss(control.tf(up, down, T), inputs=[name], outputs=[to], name=f"{name} to {to}")

    h, integral = observer or 0.0, (ki or 0.0) * T
    # The derivative is N (z - 1)/(z - 1 + N T) q, or the measured velocity.
    derivative = block([1.0], [1.0], "v", "v_f") if rate is None else block([rate, -rate], [1.0, rate * T - 1.0], "q", "v_f")
    # The disturbance estimate is d = (h m (z - 1) v_f - h T tau) / (z - 1 + h T).
    loop = control.interconnect(
        [
            control.ss(
                [[1, T], [0, 1]], [[T * T / 2 / MASS], [T / MASS]], np.eye(2), 0, T, inputs=["tau"], outputs=["q", "v"], name="mass"
            ),
            control.summing_junction(["r", "-q"], "e", name="error"),
            block([kp, integral - kp], [1.0, -1.0], "e", "ahead"),
            derivative,
            block([kd], [1.0], "v_f", "back"),
            block([h * m, -h * m], [1.0, h * T - 1.0], "v_f", "momentum"),
            block([h * T], [1.0, h * T - 1.0], "tau", "known"),
            control.summing_junction(["ahead", "-back", "-momentum", "known"], "tau", name="torque"),
        ],
        inputs=["r"],
        outputs=["q", "v"],
    )
    _, expected = control.forced_response(loop, np.arange(run.t.size) * T, np.full(run.t.size, 0.2))
    np.testing.assert_allclose(np.hstack([run.q, run.v]), expected.T, rtol=0.0, atol=1e-9)
    assert np.abs(run.q[-1, 0] - 0.2) < 4e-2


@pytest.mark.parametrize("tau_max", [None, 3.0])
@pytest.mark.parametrize("v0", [0.0, 0.7])
def test_the_observer_finds_a_force_through_its_filter(v0: float, tau_max: float | None) -> None:
    """For a mass the disturbance estimate is d = h/(p + h) F with the Laplace variable p, for all gains and under saturation."""
    arm, h, pushed = mass(gravity=9.81), 25.0, 12.0
    law = al.PID(arm, [0.3], 50.0, None, 12.0, tau_max, observer_bandwidth=h)
    run = al.simulate(
        al.RigidArm(arm),
        law,
        [0.0],
        v0=[v0],
        t_end=0.3,
        method="dop853",
        rtol=1e-12,
        atol=1e-13,
        force=[pushed, 0.0, 0.0],
        force_frame="link1",
    )
    assert run.estimate is not None
    found = [law.terms(t, q, v, state=z)["disturbance"][0] for t, q, v, z in zip(run.t, run.q, run.v, run.estimate, strict=True)]
    np.testing.assert_allclose(found, pushed * (1.0 - np.exp(-h * run.t)), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("sample_time", [None, 1e-3])
@pytest.mark.parametrize("options", [{}, {"derivative_filter": 300.0}], ids=["measured", "filtered"])
def test_a_payload_unknown_to_the_law_leaves_no_error(options: dict[str, Any], sample_time: float | None) -> None:
    arm, goal = models.TWO_LINKS, [0.4, -0.3]
    plant = al.RigidArm(arm.with_payload("link2", 1.5, [0.0, 0.0, 0.0], np.zeros((3, 3))))

    def error(**more: Any) -> float:
        law = al.PID(arm, goal, 80.0, None, 18.0, **options, **more)
        return float(np.abs(al.simulate(plant, law, [0.0, 0.0], t_end=6.0, dt=1e-3, sample_time=sample_time).q[-1] - goal).max())

    # Without the observer, the payload causes an error.
    assert error(observer_bandwidth=15.0) < 1e-9 and error() > 0.05


def test_friction_is_fed_forward() -> None:
    """If the law knows the viscous and Coulomb friction, the tracking error is less than five times that of an arm without friction."""
    free = models.TWO_LINKS
    arm = free.with_drives(damping=[2.0, 1.0], friction=[4.0, 2.0])
    swing = al.Sinusoid([0.3, -0.2], [0.4, 0.3], [2.0, 3.0], [0.0, 0.5])

    def error(arm: al.Arm, **options: Any) -> float:
        plant = al.RigidArm(arm, friction=True)
        q0, v0, _ = swing(0.0)
        run = al.simulate(plant, al.PID(arm, swing, 200.0, None, 40.0, **options), q0, v0=v0, t_end=4.0, dt=1e-4, record_every=10)
        return float(np.abs(run.q - positions(swing, run.t)).max())

    best, without, fed = error(free), error(arm), error(arm, friction=True, friction_speed=0.02)
    assert fed < 5.0 * best and without > 20.0 * fed


def test_acceleration_is_fed_forward() -> None:
    """For one joint, whose inertia is constant, a motion that starts on its target is tracked up to the method's error."""
    arm, swing = mass(gravity=9.81), al.Sinusoid([0.3], [0.4], [5.0], [0.5])
    q0, v0, _ = swing(0.0)
    for options in ({}, {"observer_bandwidth": 30.0}):
        run = al.simulate(
            al.RigidArm(arm), al.PID(arm, swing, 50.0, 10.0, 8.0, **options), q0, v0=v0, t_end=2.0, method="dop853", rtol=1e-11
        )
        assert np.abs(run.q - positions(swing, run.t)).max() < 1e-8


def test_without_options_the_law_is_as_before() -> None:
    """Without an integral, PID gives the torque of `PDGravity`. A target as an array and as a `Hold` give the same torque."""
    arm = models.THREE_LINKS
    q, v, goal = np.full(3, 0.2), np.full(3, -0.1), np.full(3, 0.5)
    np.testing.assert_array_equal(al.PID(arm, goal, 50.0, None, 5.0)(0.0, q, v), al.PDGravity(arm, goal, 50.0, 5.0)(0.0, q, v))
    np.testing.assert_array_equal(al.PID(arm, goal, 50.0, 3.0, 5.0)(0.0, q, v), al.PID(arm, al.Hold(goal), 50.0, 3.0, 5.0)(0.0, q, v))


def test_refusals() -> None:
    arm = models.TWO_LINKS

    def refused(message: str, **options: Any) -> None:
        with pytest.raises(al.InputError, match=rf"^PID: {message}"):
            al.PID(arm, [0.0, 0.0], 10.0, 1.0, 2.0, **options)

    for name in ("derivative_filter", "observer_bandwidth"):
        refused(rf"{name} is not positive: .*got -1.*index 1", **{name: [1.0, -1.0]})
        refused(rf"{name} is not finite", **{name: np.inf})
        refused(rf"{name} is not positive: .*got NaN", **{name: np.nan})
        refused(rf"{name} has the wrong shape", **{name: [1.0, 2.0, 3.0]})
    refused(r"friction_speed is not positive", friction=True, friction_speed=0.0)
    refused(r"friction_speed is not used", friction_speed=0.1)
    refused(r"nominal_inertia is not used", nominal_inertia=1.0)
    refused(r"nominal_inertia is not positive", nominal_inertia=0.0, observer_bandwidth=5.0)
    with pytest.raises(al.InputError, match=r"^PID: target has the wrong shape"):
        al.PID(arm, [0.0], 10.0, 1.0, 2.0)
    with pytest.raises(al.InputError, match=r"^PID: motion"):
        al.PID(arm, al.Hold([0.0]), 10.0, 1.0, 2.0)
