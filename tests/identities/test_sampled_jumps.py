"""Jumps of the input: a sampled law holds its output at a jump between its sample times, and steps do not straddle a jump."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.TWO_LINKS
PERIOD = 0.1
#: A force that jumps between two samples, at a sample, and just beside a sample, up to rounding.
JUMPS = {"between": 0.05, "at a sample": PERIOD, "beside a sample": 3 * PERIOD - 1e-16, "after a sample": float(np.nextafter(0.2, 1.0))}


def law(kp: float = 0.5, kd: float = 0.05) -> al.PDGravity:
    return al.PDGravity(ARM, target=[0.3, 0.2], kp=kp, kd=kd)


@pytest.mark.parametrize("jump", JUMPS.values(), ids=list(JUMPS))
@pytest.mark.parametrize("method", ["dopri5", "dop853", "rodas4"])
def test_only_samples_change_the_torque(method: str, jump: float) -> None:
    t = 0.0025 * (np.arange(160) + 0.5)
    options = {"t_end": 0.4, "sample_time": PERIOD, "t_eval": t, "force": [(jump, [0.2, 0.1, 0.0])], "force_frame": "link2"}
    run = al.simulate(al.RigidArm(ARM), law(), [0.0, 0.0], method=method, rtol=1e-9, atol=1e-12, **options)
    # The torque changes only at the samples. A period has 40 records, none at a sample.
    changes = np.flatnonzero(np.any(np.diff(run.tau, axis=0) != 0.0, axis=1)) + 1
    assert changes.tolist() == [40, 80, 120]
    # The run with fixed steps has a step that ends at the jump. The difference is the error of RK4 and of the rounded time of the jump.
    fixed = al.simulate(al.RigidArm(ARM), law(), [0.0, 0.0], dt=2.5e-3, **options)
    np.testing.assert_allclose(run.tau, fixed.tau, rtol=0.0, atol=1e-7)


@pytest.mark.parametrize("method", ["dopri5", "dop853"])
def test_derivatives_are_those_of_the_run(method: str) -> None:
    """Sensitivities equal central differences across a jump of the force."""

    def run(kp: float, **keywords: object) -> al.Run:
        options = {"rtol": 1e-10, "atol": 1e-12, "monitors": False, "method": method, "sample_time": PERIOD}
        force = {"force": [(0.05, [0.2, 0.1, 0.0])], "force_frame": "link2"}
        return al.simulate(al.RigidArm(ARM), law(kp), [0.0, 0.0], t_end=0.3, t_eval=[0.05, 0.1, 0.3], **options, **force, **keywords)

    step = 1e-4
    differences = (run(0.5 + step).q - run(0.5 - step).q) / (2.0 * step)
    slope = run(0.5, sensitivity="law.kp").sensitivity["law.kp"]
    # The error of the differences is of the order step^2.
    np.testing.assert_allclose(slope.q[:, :, 0], differences, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("jump", [0.3, 3 * 0.1, 0.3 + 1e-13, 0.3 - 1e-13, 0.31], ids=repr)
@pytest.mark.parametrize("keywords", [{}, {"record_every": 1}, {"monitors": False}], ids=str)
def test_fixed_steps_keep_their_order_at_a_jump(jump: float, keywords: dict[str, Any]) -> None:
    """RK4 has the order four also if the jump is not exactly a multiple of dt: `3 * 0.1` is later than 0.3."""

    def end(**method: Any) -> np.ndarray:
        force = {"force": [(jump, [2.0, 1.0, 0.0])], "force_frame": "link2"}
        return al.simulate(al.RigidArm(ARM), law(5.0, 0.5), [0.0, 0.0], t_end=0.6, **force, **method).q[-1]

    exact = end(method="dop853", rtol=1e-12, atol=1e-14)
    errors = [np.abs(end(dt=dt, **keywords) - exact).max() for dt in (0.02, 0.01)]
    assert errors[0] < 1e-6 and 12.0 < errors[0] / errors[1] < 25.0


def test_a_sample_at_a_jump_sees_the_motion_after_it() -> None:
    """The acceleration changes its sign at `3 * 0.1`, one rounding error after the sample at 0.3. The sample has the new sign."""
    motion = al.BangBang([0.0, 0.0], [0.3, 0.2], 2 * (3 * 0.1))
    tracking = al.ComputedTorque(ARM, motion, kp=100.0, kd=20.0)
    options: dict[str, Any] = {"t_end": 0.5, "sample_time": PERIOD, "t_eval": [0.25, 0.35, 0.45]}
    runs = [al.simulate(al.RigidArm(ARM), tracking, [0.0, 0.0], **options, **method) for method in ({"dt": 0.01}, {"method": "dop853"})]
    np.testing.assert_allclose(runs[0].tau, runs[1].tau, rtol=0.0, atol=1e-5)
    assert runs[0].tau[1, 0] < runs[0].tau[0, 0] - 1.0
