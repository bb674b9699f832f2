"""Systems for python-control of laws with states: responses compared with `simulate`, and constant disturbances that the law removes."""

from __future__ import annotations

from typing import Any

import control
import matplotlib.pyplot as plt
import models
import numpy as np
import pytest

import armlet as al

ARM = models.TWO_HEAVY_LINKS
HOLD = np.array([0.3, 1.0])
TIP: dict[str, Any] = {"frame": "link2", "axes": "xy"}
TARGET = ARM.position(HOLD, "link2")[:2]
STIFF = [[800.0, 50.0], [50.0, 500.0]]
GUARDED = al.Guarded(al.PID(ARM, HOLD, 80.0, 30.0, 15.0), al.MomentumObserver(ARM, 30.0))
INTEGRAL = al.CartesianImpedance(ARM, TARGET, 300.0, 40.0, **TIP, integral_gain=200.0)
ELASTIC = al.ElasticImpedance(ARM, TARGET, 300.0, 40.0, STIFF, [0.4, 0.3], 0.1, **TIP, integral_gain=200.0)

LAWS: dict[str, al.Law] = {
    "PID": al.PID(ARM, HOLD, 80.0, 60.0, 15.0),
    "PID, limits": al.PID(ARM, HOLD, 80.0, 60.0, 15.0, tau_max=60.0),
    "PD with filter and observer": al.PID(ARM, HOLD, 80.0, None, 15.0, derivative_filter=300.0, observer_bandwidth=20.0),
    "PID with filter and observer": al.PID(ARM, HOLD, 80.0, 60.0, 15.0, derivative_filter=300.0, observer_bandwidth=20.0),
    "impedance": INTEGRAL,
    "elastic impedance": ELASTIC,
    "guarded": GUARDED,
    "adaptive": al.Adaptive(ARM, al.Hold(HOLD), 100.0, 20.0, 1.0, estimate=ARM.parameters),
    "rotors": al.Adaptive(ARM, al.Hold(HOLD), 100.0, 20.0, 0.5, estimate=np.append(ARM.parameters, [0.0, 0.0]), armature=True),
    "leakage": al.Adaptive(ARM, al.Hold(HOLD), 100.0, 20.0, 0.5, estimate=ARM.parameters, leakage=0.3, leakage_centre=ARM.parameters),
    "dead zone": al.Adaptive(ARM, al.Hold(HOLD), 100.0, 20.0, 0.5, estimate=ARM.parameters, dead_zone=0.5),
}
TIMES = np.linspace(0.0, 1.0, 11)
TIGHT: dict[str, Any] = {"method": "dop853", "rtol": 1e-11, "atol": 1e-14, "t_eval": TIMES, "check_limits": False}


def plant_of(law: al.Law) -> al.Plant:
    return al.ElasticArm(ARM, STIFF, [0.4, 0.3]) if isinstance(law, al.ElasticImpedance) else al.RigidArm(ARM)


def states(run: al.Run) -> Any:
    """The states of a run at its records, (K, states)."""
    parts = [getattr(run, name) for name in ("q", "v", "theta", "theta_dot", "estimate")]
    return np.concatenate([values for values in parts if values is not None], axis=1)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_a_small_deviation_responds_as_it_is_simulated(law: al.Law) -> None:
    """At a distance of 1e-5 from the equilibrium, the linear system neglects terms of second order: 3e-10 N m of 2e-4 N m and less."""
    plant, off = plant_of(law), 1e-5 * np.array([1.0, -2.0])
    rest = states(al.simulate(plant, law, HOLD, t_end=0.0, **(TIGHT | {"t_eval": [0.0]})))[0]
    run = states(al.simulate(plant, law, HOLD + off, v0=2.0 * off, t_end=1.0, **TIGHT)) - rest
    linear = al.to_control(plant, law, HOLD)
    assert linear.nstates == len(rest) == al.to_control(plant, law).nstates
    response = control.initial_response(linear, TIMES, run[0])
    np.testing.assert_allclose(response.outputs[: linear.nstates].T, run, rtol=0.0, atol=2e-5 * np.abs(run).max())


REMOVING = [name for name in LAWS if name.startswith("P") or "impedance" in name]


@pytest.mark.parametrize("name", REMOVING)
def test_an_integral_or_an_observer_removes_a_constant_disturbance(name: str) -> None:
    """The gain from `d` to `q` is zero, and the simulated arm under a constant force returns to its target."""
    law = LAWS[name]
    plant = plant_of(law)
    linear = al.to_control(plant, law, HOLD)
    gain = control.dcgain(linear[["q1", "q2"], ["d1", "d2"]])
    np.testing.assert_allclose(gain, 0.0, rtol=0.0, atol=1e-12)
    # The slowest pole is above 0.6 1/s, so 1e-10 of the deviation remains after 40 s.
    run = al.simulate(
        plant,
        law,
        HOLD,
        t_end=40.0,
        method="rodas4",
        force=[1.0, -2.0] if "impedance" in name else [1.0, -2.0, 0.0],
        **({} if "impedance" in name else {"force_frame": "link2"}),
    )
    np.testing.assert_allclose(run.q[-1], HOLD, rtol=0.0, atol=1e-6)
    assert np.abs(run.q - HOLD).max() > 1e-3


def test_estimates_that_gravity_does_not_show_have_poles_at_zero() -> None:
    """At rest, gravity shows two combinations of twenty estimates. The others are constant, so `dcgain` is NaN, but not at low frequencies.

    Without gravity, no estimate changes at rest. The gain is then that of the PD control.
    """
    low = 1e-4j
    for gravity, count in ([0.0, -9.81], 18), ([0.0, 0.0], 20):
        arm = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], gravity=gravity)
        law = al.Adaptive(arm, al.Hold(HOLD), 100.0, 20.0, 1.0, estimate=arm.parameters)
        linear = al.to_control(arm, law, HOLD)
        assert (np.abs(linear.poles()) < 1e-6).sum() == count
        gain = linear[["q1", "q2"], ["d1", "d2"]](low)
        wanted = np.zeros((2, 2)) if count == 18 else np.linalg.inv(np.diag([100.0, 100.0]))
        np.testing.assert_allclose(gain, wanted, rtol=0.0, atol=1e-6)


def test_without_an_integral_gain_a_law_has_no_integral() -> None:
    """A constant integral would be a pole at zero, and its gains would be NaN."""
    law = al.PID(ARM, HOLD, 80.0, None, 15.0)
    run = al.simulate(al.RigidArm(ARM), law, HOLD, t_end=0.1, dt=1e-2)
    assert run.estimate is None and "integral" not in law.terms(0.0, HOLD, [0.0, 0.0])
    linear = al.to_control(ARM, law, HOLD)
    np.testing.assert_allclose(control.dcgain(linear[["q1", "q2"], ["d1", "d2"]]), np.eye(2) / 80.0, rtol=1e-12, atol=1e-15)
    run = al.simulate(al.RigidArm(ARM), LAWS["PD with filter and observer"], HOLD, t_end=0.1, dt=1e-2)
    assert run.estimate is not None and run.estimate.shape[1] == 4
    figure = plt.figure()
    run.plot(figure)
    plt.close(figure)


@pytest.mark.parametrize("law", [INTEGRAL, ELASTIC], ids=["rigid", "elastic"])
def test_poles_are_the_eigenvalues_of_equilibrium(law: al.Law) -> None:
    """Both include the integral of the law."""
    plant = plant_of(law)
    rest = al.equilibrium(plant, law, q0=HOLD + 0.2)
    assert rest.estimate is not None
    motors = [] if rest.theta is None else [rest.theta, [0.0, 0.0]]
    found = np.sort_complex(al.to_control(plant, law, np.concatenate([rest.q, [0.0, 0.0], *motors, rest.estimate])).poles())
    # The equilibrium has an error of about 1e-9, and the eigenvalues have a relative rounding error of 1e-11.
    np.testing.assert_allclose(found, np.sort_complex(rest.eigenvalues), rtol=0.0, atol=1e-6 * np.abs(found).max())
