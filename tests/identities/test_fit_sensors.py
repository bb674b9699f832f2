"""`fit_log` of an arm with errors of its sensors: torque constants, encoder offsets and the delay, on logs of a simulator in numpy."""

from __future__ import annotations

import log_trials
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

ARM = log_trials.arm().with_drives(armature=log_trials.ROTORS)
CONSTANTS, OFFSETS, DELAY = np.array([1.0, 1.1, 0.9]), np.array([0.0, 0.05, -0.03]), 0.0123
KNOWN = ("viscous", "coulomb", "offsets")


def recorded(seed: int, *, scaled: bool = True, shifted: bool = True) -> tuple[al.Log, log_trials.Robot]:
    """A log whose torques are divided by `CONSTANTS` and recorded `DELAY` early, and whose positions are shifted by `OFFSETS`."""
    rng = np.random.default_rng(seed)
    robot = log_trials.Robot(rng)
    t = log_trials.PERIOD * np.arange(4000)
    tau = robot.motors(t + DELAY)[1] / (CONSTANTS if scaled else 1.0)
    q = robot.motors(t)[0] + (OFFSETS if shifted else 0.0)
    return log_trials.as_recorded(rng, t, q, tau, log_trials.NOISE), robot


@pytest.mark.parametrize(("time", "sign"), [("delay", 1.0), ("clock_offset", -1.0)])
def test_errors_of_sensors_of_a_known_arm(time: str, sign: float) -> None:
    log, robot = recorded(3)
    fit = al.fit_log(ARM, log, (*KNOWN, "torque_constants", "encoder_offsets", time))
    truth = np.concatenate([log_trials.VISCOUS, log_trials.COULOMB, robot.offset, CONSTANTS, OFFSETS, [sign * DELAY]])
    assert np.all(np.abs(fit.values - truth) < 4.0 * fit.deviations) and fit.deviations[-1] < 1e-3
    np.testing.assert_allclose(fit.torque_constants, CONSTANTS, atol=0.02)
    np.testing.assert_allclose(fit.encoder_offsets, OFFSETS, atol=0.01)
    assert fit.delay == sign * fit.values[-1] and fit.names[-1] == time
    # The torque does not depend on the angle about the vertical axis.
    assert fit.unidentifiable[0] == "not identifiable from this log: encoder_offset[yaw]"
    assert fit.refuted == ()
    # Without these kinds, the errors of the sensors are refuted.
    found = {each.name for each in al.fit_log(ARM, log, KNOWN).refuted}
    assert {"torque_constant", "delay"} <= found


def test_deviations_of_sensors_cover_the_errors() -> None:
    """Of 60 logs, 95 % of the errors are within two deviations. The bounds are two deviations of the share of about 720 values."""
    within = []
    for seed in range(60):
        log, robot = recorded(seed, shifted=False)
        fit = al.fit_log(ARM, log, (*KNOWN, "torque_constants", "delay"))
        truth = np.concatenate([log_trials.VISCOUS, log_trials.COULOMB, robot.offset, CONSTANTS, [DELAY]])
        within.append(np.abs(fit.values - truth) < 2.0 * fit.deviations)
    assert 0.92 < np.mean(within) < 0.98


def test_offsets_and_delay_beside_unknown_bodies() -> None:
    """A rotation of the last body has the same effect as an offset of the last encoder. The offset of the second one has no such body."""
    log, _ = recorded(4, scaled=False)
    kinds = ("inertia", "viscous", "coulomb", "offsets", "encoder_offsets", "delay")
    fit = al.fit_log(ARM, log, kinds)
    named = dict(zip(fit.names, zip(fit.values, fit.deviations, strict=True), strict=True))
    for name, truth in (("encoder_offset[shoulder]", OFFSETS[1]), ("delay", DELAY)):
        value, deviation = named[name]
        assert abs(value - truth) < 4.0 * deviation
    for joint in ("yaw", "elbow"):
        assert f"not identifiable from this log: encoder_offset[{joint}]" in fit.unidentifiable
    assert "not identifiable from this log: mcx[elbow]" in fit.unidentifiable
    assert np.isfinite(named["Iyy[elbow]"][1])
    assert fit.refuted == ()


def test_torque_constants_beside_unknown_bodies_have_no_scale() -> None:
    log, _ = recorded(5, shifted=False)
    fit = al.fit_log(ARM.with_drives(armature=0.0), log, ("inertia", "rotors", *KNOWN, "torque_constants", "delay"))
    for joint in log_trials.NAMES:
        assert f"not identifiable from this log: torque_constant[{joint}]" in fit.unidentifiable
    assert "torque constants and other parameters have a common factor: fit torque_constants without inertia" in fit.unidentifiable
    # Their ratios are identifiable.
    np.testing.assert_allclose(fit.torque_constants / fit.torque_constants[0], CONSTANTS, rtol=0.05)
    assert fit.delay == pytest.approx(DELAY, abs=2e-3)


def test_delay_alone_and_both_kinds_of_it() -> None:
    log, _ = recorded(6, scaled=False, shifted=False)
    known = ARM.with_drives(damping=log_trials.VISCOUS)
    assert al.fit_log(known, log, ("delay",)).names == ("delay",)
    with pytest.raises(al.InputError, match=r"^fit_log: names have delay and clock_offset, whose effects are equal: expected one of them"):
        al.fit_log(ARM, log, ("delay", "clock_offset"))
    possible = al.fit_log(ARM, log, ("inertia", *KNOWN, "torque_constants"), delay=DELAY, consistent=True)
    np.testing.assert_allclose(possible.torque_constants / possible.torque_constants[0], 1.0, rtol=0.05)
