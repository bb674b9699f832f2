"""Sampled controllers against `armlet.reference`. One seed gives the same random numbers in both libraries.

armlet keeps a ring buffer of samples and looks up the active one. The reference processes a list of events in order of time.
Its random numbers use Python's unbounded integers, and its sensor filter is a matrix exponential.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from loops import close, law_pair, pair

import armlet as al
from armlet import reference

# Rounding errors of the accelerations, and of the complex-step derivatives of the reference, grow over the steps.
ROUNDING = 1e-9
PERIOD = 4e-3

SAMPLINGS: dict[str, dict[str, Any]] = {
    "plain": {},
    "delay": {"delay": 3e-3},
    "delay of two periods": {"delay": 9e-3},
    "jitter": {"jitter": 3.5e-3, "seed": 3},
    "jitter and delay": {"jitter": 3e-3, "delay": 5e-3, "seed": 2**63 + 5},
    "late sensors": {"sensor_delay": 2},
    "noise": {"noise": {"q": 1e-3, "v": 0.05}, "seed": 11},
    "resolution": {"resolution": {"q": 2e-3, "v": 0.1}},
    "rate limit": {"rate_limit": 400.0},
    "all": {
        "delay": 2e-3,
        "jitter": 2e-3,
        "sensor_delay": 1,
        "noise": {"q": 1e-3, "v": 0.02},
        "resolution": {"v": 0.01},
        "rate_limit": 900.0,
        "seed": 7,
    },
}


def both(seed: int, n: int, law: str, options: dict[str, Any], sampling: dict[str, Any], **plant: Any) -> tuple[Any, dict[str, Any]]:
    """Return armlet's run and the reference's run."""
    rng = np.random.default_rng(seed)
    arms = pair(rng, n)
    laws = law_pair(rng, law, arms)
    q0, v0 = rng.uniform(-0.3, 0.3, (2, n))
    runs = [
        library.simulate(library.RigidArm(arm, **plant), each, q0, v0=v0, sample_time=library.Sampling(PERIOD, **sampling), **options)
        for library, arm, each in zip((al, reference), arms, laws, strict=True)
    ]
    return runs[0], runs[1]


@pytest.mark.parametrize("sampling", SAMPLINGS.values(), ids=SAMPLINGS.keys())
@pytest.mark.parametrize("law", ["Adaptive", "PDGravity"])
def test_sampled_runs(law: str, sampling: dict[str, Any]) -> None:
    options: dict[str, Any] = {"t_end": 0.04, "dt": 1e-3, "tau_max": [30.0, 20.0]}
    run, expected = both(21, 2, law, options, sampling)
    for name in ("q", "v", "tau"):
        close(getattr(run, name), expected[name], ROUNDING)
    close(run.monitors["energy_balance"], expected["energy_balance"], ROUNDING)
    if law == "Adaptive":
        close(run.estimate, expected["estimate"], ROUNDING)
    if sampling:
        plain, _ = both(21, 2, law, options, {})
        assert np.abs(run.tau - plain.tau).max() > 1e-3


def test_a_period_is_a_step() -> None:
    """Without `dt`, a fixed-step method uses the sample time as its step."""
    run, expected = both(22, 3, "PDGravity", {"t_end": 0.06}, {"noise": {"v": 0.01}})
    assert run.t.size == 16
    close(run.q, expected["q"], ROUNDING)


@pytest.mark.parametrize("sampling", [{"delay": 1.7e-3}, {"jitter": 3e-3, "seed": 4, "noise": {"q": 1e-3}}], ids=["delay", "jitter"])
def test_instants_between_steps(sampling: dict[str, Any]) -> None:
    """An adaptive method stops at each sampling instant, without rounding its time.

    DOP853 and Gragg-Bulirsch-Stoer, both at 1e-11, agree to 1e-9.
    """
    options = {"t_end": 0.03, "t_eval": [0.011, 0.03], "rtol": 1e-11, "atol": 1e-11}
    rng = np.random.default_rng(23)
    arms = pair(rng, 2)
    laws = law_pair(rng, "PDGravity", arms)
    q0 = rng.uniform(-0.3, 0.3, 2)
    clocks = al.Sampling(PERIOD, **sampling), reference.Sampling(PERIOD, **sampling)
    run = al.simulate(al.RigidArm(arms[0]), laws[0], q0, method="dop853", sample_time=clocks[0], **options)
    expected = reference.simulate(reference.RigidArm(arms[1]), laws[1], q0, method="gbs", sample_time=clocks[1], **options)
    for name in ("q", "v", "tau"):
        close(getattr(run, name), expected[name], 1e-9)


@pytest.mark.parametrize(
    "sensor",
    [
        {},
        {"bandwidth": 300.0},
        {"noise": 0.2, "bias": [0.3, -0.2, 0.1]},
        {"resolution": 0.5, "bandwidth": 900.0, "bias": 0.2, "noise": 0.1},
    ],
    ids=["ideal", "slow", "noisy", "all"],
)
def test_torque_sensors(sensor: dict[str, Any]) -> None:
    arms = pair(np.random.default_rng(31), 3)
    q0 = np.array([0.2, -0.1, 0.15])
    K, B = np.array([900.0, 700.0, 500.0]), np.array([0.4, 0.3, 0.2])
    frame = arms[0].frame_names[-1]
    runs = []
    for library, arm in zip((al, reference), arms, strict=True):
        target = arms[0].position(q0 + 0.1, frame)
        # The law assumes 0.9 times the stiffness of the plant.
        given = (target, [60.0, 50.0, 40.0], [6.0, 5.0, 4.0], 0.9 * K, B, 0.5 * B)
        law = library.ElasticImpedance(arm, *given, frame=frame, axes="xyz")
        clock = library.Sampling(
            2e-3, torque_sensor=library.TorqueSensor(**sensor), noise={"theta": 1e-4}, resolution={"theta_dot": 1e-3}, seed=5, jitter=1e-3
        )
        runs.append(library.simulate(library.ElasticArm(arm, K, B), law, q0, t_end=0.03, dt=5e-4, sample_time=clock))
    for name in ("q", "v", "theta", "theta_dot", "tau"):
        close(getattr(runs[0], name), runs[1][name], ROUNDING)


def test_rows_have_seeds_of_their_own() -> None:
    rng = np.random.default_rng(41)
    arms = pair(rng, 2)
    laws = law_pair(rng, "PDGravity", arms)
    q0, v0 = rng.uniform(-0.3, 0.3, (2, 3, 2))
    noise = {"noise": {"q": 1e-3, "v": 0.02}, "jitter": 2e-3}
    options: dict[str, Any] = {"t_end": 0.03, "dt": 1e-3, "tau_max": [30.0, 20.0]}
    batch = al.simulate_batch(al.RigidArm(arms[0]), laws[0], q0, v0=v0, sample_time=al.Sampling(PERIOD, seed=9, **noise), **options)
    for row in range(3):
        clock = reference.Sampling(PERIOD, seed=9 + row, **noise)
        expected = reference.simulate(reference.RigidArm(arms[1]), laws[1], q0[row], v0=v0[row], sample_time=clock, **options)
        for name in ("q", "v", "tau"):
            close(getattr(batch, name)[row], expected[name], ROUNDING)


def test_friction_of_the_drives() -> None:
    """Runs with joint friction agree, continuous and sampled with a rate limit.

    No joint reverses, so Coulomb friction does not jump.
    """
    for clock in (None, {"rate_limit": 500.0}):
        runs = []
        for library in (al, reference):
            rng = np.random.default_rng(51)
            arm = pair(rng, 3)[library is reference].with_drives(damping=[1.0, 0.5, 2.0], friction=[0.5, 0.0, 1.0])
            law, sampling = library.PDGravity(arm, [0.5, 0.4, 0.6], 40.0, 1.0), None if clock is None else library.Sampling(PERIOD, **clock)
            options: dict[str, Any] = {"t_end": 0.03, "dt": 1e-3, "v0": [2.0, 2.0, 2.0], "sample_time": sampling}
            runs.append(library.simulate(library.RigidArm(arm, friction=True), law, np.zeros(3), **options))
        run, expected = runs
        assert run.v.min() > 0.1
        for name in ("q", "v", "tau"):
            close(getattr(run, name), expected[name], ROUNDING)
        close(run.monitors["energy_balance"], expected["energy_balance"], ROUNDING)
