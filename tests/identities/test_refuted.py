"""`fit.refuted` on logs of a simulator in numpy: each wrong assumption is named first, and right logs are not refuted.

`python tests/identities/log_trials.py 100` repeats this with 100 logs for each assumption.
"""

from __future__ import annotations

import pickle

import log_trials
import numpy as np
import pytest
from scipy import stats

import armlet as al
from armlet.fitting import statistics

#: Parts of the sentences with the size of the fault. The delay is one sample of 5 ms, and the estimate is rounded.
SIZES = {
    "delay": "ms later than assumed",
    "torque_constant": "joint 'elbow': the recorded torque is 1.1",
    "gravity": "gravity is tilted by about",
}


def test_the_simulator_has_the_equations_of_the_arm() -> None:
    q, v, a = np.random.default_rng(0).normal(size=(3, 5, 3))
    np.testing.assert_allclose(log_trials.bodies(q, v, a), log_trials.arm().inverse_dynamics(q, v, a), atol=1e-12)


@pytest.mark.parametrize("name", [name for name in log_trials.FAULTS if name != "saturation"])
def test_a_wrong_assumption_is_named_first(name: str) -> None:
    fit = log_trials.trial(name, 1)
    assert log_trials.first(fit) == name
    found = fit.refuted[0]
    assert found.p_value < 1e-4 and 0.2 < found.share <= 1.0 and str(found) in str(fit)
    if name in SIZES:
        assert SIZES[name] in str(found)


def test_right_logs_are_not_refuted() -> None:
    assert [log_trials.first(log_trials.trial("", seed)) for seed in range(2)] == [""] * 2


def test_a_fault_in_the_span_is_unidentifiable() -> None:
    """The rotor of the first joint has the same torque as the moment of inertia of its body."""
    fit = log_trials.trial("rotors", 4)
    assert "not distinguishable from the fitted parameters: rotor inertia of joint 'yaw'" in fit.unidentifiable
    assert all(each.joint != "yaw" for each in fit.refuted if each.name == "rotors")


def test_exact_logs_and_projected_fits() -> None:
    """Errors of the filter are not judged, and a projected fit has the tests of the fit before."""
    rng = np.random.default_rng(5)
    robot = log_trials.Robot(rng)
    t = log_trials.PERIOD * np.arange(4000)
    q, v, a = (robot.motion(t, order) for order in range(3))
    arm = log_trials.arm()
    fit = al.fit_log(arm, al.Log(t, q, tau=arm.inverse_dynamics(q, v, a), names=log_trials.NAMES), ["inertia"])
    assert fit.refuted == ()
    log = log_trials.recorded(rng, robot, log_trials.NOISE, 0)
    projected = al.fit_log(arm, log, ["inertia", "viscous", "rotors"], consistent=True)
    assert projected.before is not None and projected.refuted == projected.before.refuted
    assert projected.refuted[0].name in ("coulomb", "offsets")
    copy = pickle.loads(pickle.dumps(projected))
    assert copy.refuted == projected.refuted


def test_delay_of_the_torques() -> None:
    """A known delay is removed: of whole samples, and of parts of samples."""
    rng = np.random.default_rng(6)
    robot = log_trials.Robot(rng)
    for delay in (0.005, 0.0125, -0.005):
        t = log_trials.PERIOD * np.arange(4000)
        log = al.Log(t, robot.motors(t)[0], tau=robot.motors(t + delay)[1], names=log_trials.NAMES)
        fits = [al.fit_log(log_trials.arm(), log, log_trials.KINDS, delay=each) for each in (delay, 0.0)]
        assert np.all(fits[0].residuals < 0.3 * fits[1].residuals)


@pytest.mark.parametrize(("count", "degrees"), [(1, 4.0), (2, 75.0), (10, 300.0), (3, 1e4)])
def test_tail_of_the_f_distribution(count: int, degrees: float) -> None:
    """Against scipy. The continued fraction has 200 terms, and its error is that of rounding."""
    for value in (0.0, 1e-3, 0.7, 1.0, 3.0, 30.0, 200.0):
        want = stats.f.sf(value, count, degrees)
        assert statistics.f_tail(value, count, degrees) == pytest.approx(want, rel=1e-9, abs=1e-300)


def test_holm() -> None:
    """The example of four probabilities: 0.01 < 0.05/4 and 0.012 < 0.05/3, but 0.03 > 0.05/2."""
    np.testing.assert_array_equal(statistics.holm([0.03, 0.01, 0.012, 0.9], 0.05), [False, True, True, False])
    np.testing.assert_array_equal(statistics.holm([0.001, 0.002], 0.05), [True, True])
    assert len(statistics.holm([], 0.05)) == 0


def test_covariance_of_correlated_sums() -> None:
    """Sums of a moving average of four numbers have 16 times the variance of the numbers, for each sample."""
    white = np.random.default_rng(7).normal(size=(20000, 2))
    moving = sum(white[k : len(white) - 4 + k] for k in range(4))
    V = statistics.covariance_of_sum(np.asarray(moving), 8) / len(white)
    np.testing.assert_allclose(V, 16.0 * np.eye(2), atol=1.0)
