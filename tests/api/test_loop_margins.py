"""Margins of loops with known solutions, refused arguments, and margins of loops that are not stable."""

from __future__ import annotations

import pickle
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

LINK = al.planar_arm([1.0], masses=[2.0], coms=[0.5], inertias=[0.5], gravity=(0.0, 0.0))  # 1 kg m^2 about the joint
G = 5.0  # N m, the gravity torque of the pendulum at 90 degrees
PENDULUM = al.pendulum(2.0, G)
ARM = models.TWO_HEAVY_LINKS
PD = al.PDGravity(ARM, [0.3, 1.0], [150.0, 30.0], [30.0, 3.0])


def test_pd_of_one_inertia() -> None:
    """L = (kd s + kp) / s^2: |L| = 1 at w^4 = kp^2 + kd^2 w^2, with the phase atan(kd w / kp) above -pi."""
    kp, kd = 100.0, 12.0
    found = al.loop_margins(LINK, al.PDGravity(LINK, [0.0], kp, kd), [0.0])
    w = np.sqrt((kd**2 + np.sqrt(kd**4 + 4.0 * kp**2)) / 2.0)
    phase = np.arctan(kd * w / kp)
    assert found.stable and found.gain_low[0] == 0.0 and found.gain_high[0] == np.inf
    np.testing.assert_allclose([found.phase[0], found.delay[0]], [phase, phase / w], rtol=1e-12)
    s = 1j * np.array([0.5, 7.0])
    np.testing.assert_allclose(found.loop_gain([0.5, 7.0])[:, 0, 0], (kd * s + kp) / s**2, rtol=1e-12)
    # One joint: the margin of all joints together is that of the joint.
    assert found.disc_all == pytest.approx(found.disc[0], rel=1e-9)


def test_pd_of_one_inertia_at_samples() -> None:
    """The criterion of Jury for the double integrator: kd h f < 2 and kp h / 2 < kd, the second for every factor f."""
    kp, kd, h = 100.0, 20.0, 0.01
    found = al.loop_margins(LINK, al.PDGravity(LINK, [0.0], kp, kd), [0.0], sample_time=h)
    assert found.gain_high[0] == pytest.approx(2.0 / (h * kd), rel=1e-12) and found.gain_low[0] == 0.0


def test_a_pendulum_above_its_joint_needs_a_least_gain() -> None:
    """2 a = f (kp e - kd v + G cos(q0) dq) - G cos(q0) dq with cos(q0) = -1: stable if f (kp + G) > G."""
    kp = 20.0
    found = al.loop_margins(PENDULUM, al.PDGravity(PENDULUM, [np.pi], kp, 4.0), [np.pi])
    assert found.gain_low[0] == pytest.approx(G / (kp + G), rel=1e-6) and found.gain_high[0] == np.inf


@pytest.mark.parametrize("h", [None, 0.02])
def test_an_integrator(h: float | None) -> None:
    """L = k / s has the phase margin pi / 2, and |S - 1/2| = 1/2. At samples, L = k h / (z - 1) is stable up to k h = 2."""
    k = 5.0
    arm = al.planar_arm([1.0])
    law = al.PriorityVelocity(arm, [al.PostureTask([0.4], gain=k)])
    found = al.loop_margins(al.VelocityArm(arm), law, [0.4], sample_time=h)
    if h is None:
        np.testing.assert_allclose([found.phase[0], found.delay[0], found.disc[0]], [np.pi / 2, np.pi / (2 * k), 2.0], rtol=1e-8)
        assert found.gain_high[0] == np.inf
    else:
        # |e^(j w h) - 1| = 2 sin(w h / 2) = k h at the crossover, where L has the phase -pi / 2 - w h / 2.
        w = 2.0 * np.arcsin(k * h / 2.0) / h
        np.testing.assert_allclose([found.gain_high[0], found.phase[0]], [2.0 / (k * h), np.pi / 2 - w * h / 2], rtol=1e-8)


def test_the_margins_of_a_simulated_loop() -> None:
    """A sampled run converges just below the delay margin, and diverges just above it, with the delay at both joints."""
    clock = al.Sampling(4e-3, delay=4e-3)
    found = al.loop_margins(ARM, PD, [0.3, 1.0], sample_time=clock)

    def peaks(delay: float) -> Any:
        options: Any = {"t_end": 20.0, "dt": 1e-3, "sample_time": al.Sampling(4e-3, delay=delay)}
        run = al.simulate(al.RigidArm(ARM), PD, [0.3001, 1.0], check_limits=False, **options)
        return np.abs(run.q - [0.3, 1.0])[-2000:].max()

    counts = range(1, 30)
    stable = [al.loop_margins(ARM, PD, [0.3, 1.0], sample_time=al.Sampling(4e-3, delay=4e-3 * k)).stable for k in counts]
    first = stable.index(False)
    assert first > 0 and not any(stable[first:])
    assert peaks(4e-3 * counts[first - 1]) < 1e-4 < peaks(4e-3 * counts[first])
    assert found.delay.min() > 4e-3 * (first - 1)


def test_a_loop_that_is_not_stable_has_no_margins() -> None:
    found = al.loop_margins(ARM, PD, [0.3, 1.0], sample_time=0.5)
    assert not found.stable and found.disc_all == 0.0
    np.testing.assert_array_equal([found.gain_low, found.gain_high, found.delay, found.disc], [[1.0] * 2, [1.0] * 2, [0.0] * 2, [0.0] * 2])


def test_constant_estimates_do_not_count_as_unstable() -> None:
    law = al.Adaptive(ARM, al.Hold([0.3, 1.0]), 100.0, 20.0, 1.0, estimate=ARM.parameters)
    found = al.loop_margins(ARM, law, [0.3, 1.0])
    assert found.stable and (found.disc > 0.1).all()


def test_margins_can_be_pickled() -> None:
    found = al.loop_margins(ARM, PD, [0.3, 1.0])
    again = pickle.loads(pickle.dumps(found))
    np.testing.assert_array_equal(again.loop_gain(3.0), found.loop_gain(3.0))


@pytest.mark.parametrize(
    ("arguments", "keywords", "message"),
    [
        ((3, PD, [0.3, 1.0]), {}, "loop_margins: plant is of the wrong type"),
        ((ARM, None, [0.3, 1.0]), {}, "loop_margins: law is missing"),
        ((ARM, PD, [0.3]), {}, "loop_margins: x0 has the wrong shape"),
        ((ARM, PD, [0.3, np.nan]), {}, "loop_margins: x0 is not finite"),
        ((ARM, PD, [0.3, 1.0]), {"t": "now"}, "loop_margins: t "),
        ((ARM, PD, [0.3, 1.0]), {"sample_time": 0.0}, "loop_margins: sample_time is not positive"),
        ((ARM, PD, [0.3, 1.0]), {"sample_time": np.inf}, "loop_margins: sample_time is not positive"),
        ((ARM, PD, [0.3, 1.0]), {"sample_time": "1 ms"}, "loop_margins: sample_time "),
        ((ARM, PD, [0.3, 1.0]), {"sample_time": al.Sampling(1e-3, delay=-1e-3)}, "loop_margins: delay is negative"),
        ((ARM, PD, [0.3, 1.0]), {"sample_time": al.Sampling(1e-3, delay=np.nan)}, "loop_margins: delay is negative"),
        ((ARM, PD, [0.3, 1.0]), {"sample_time": al.Sampling(1e-3, delay=2.0)}, "loop_margins: delay is too long"),
        ((ARM, PD, [0.3, 1.0]), {"sample_time": al.Sampling(1e-3, jitter=1e-4)}, "loop_margins: sample_time has no linear model"),
        ((ARM, al.Guarded(PD, al.MomentumObserver(ARM, 30.0)), [0.3, 1.0]), {"sample_time": 1e-3}, "loop_margins: law has an observer"),
    ],
)
def test_refusals(arguments: Any, keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        al.loop_margins(*arguments, **keywords)


@pytest.mark.parametrize("frequency", [0.0, -1.0, np.inf, np.nan, 2.0e3])
def test_refused_frequencies(frequency: float) -> None:
    with pytest.raises(al.InputError, match="loop_gain: frequency"):
        al.loop_margins(ARM, PD, [0.3, 1.0], sample_time=2e-3).loop_gain(frequency)
