"""The laboratory of task priority, without and with limits of the joint speeds."""

from __future__ import annotations

import numpy as np
import pytest

import armlet as al
from armlet.live.model import FRAME, Lab
from armlet.live.systems import Limits, Priority


def run(lab: Lab, seconds: float) -> None:
    for _ in range(round(seconds / FRAME)):
        lab.advance()


def test_priority_gives_up_the_second() -> None:
    """The first task has priority over the second.

    Both errors vanish if the two targets are feasible together. Otherwise only the error of the first task vanishes.
    """
    lab = Lab([Priority()])
    run(lab, 5.0)
    assert max(float(curve[-1]) for curve in lab.panels()[0][1:]) < 1e-6
    lab.drag("tip", [0.5, 1.6, 0.0])
    lab.drag("elbow", [1.5, -1.0, 0.0])
    run(lab, 10.0)
    first, second = (float(curve[-1]) for curve in lab.panels()[0][1:])
    assert first < 1e-6 and second > 0.5
    # With a gain of zero the laboratory makes a law without the second task, and the elbow moves freely.
    lab.set("gain2", 0.0)
    lab.drag("tip", [1.5, 0.5, 0.0])
    q0, arm = lab.q, lab.system.arm
    run(lab, 0.5)
    alone = al.PriorityVelocity(arm, [al.Task("link4", "xy", [1.5, 0.5], 4.0)], "clamp", eps=0.02)
    same = al.simulate(al.VelocityArm(arm), alone, q0, t_end=31 * FRAME, dt=1e-3)
    assert np.abs(lab.q - same.q[-1]).max() < 1e-12


@pytest.mark.parametrize("method", ["clamp", "exact", "damped", "sns"])
def test_limits_of_priority_have_bands(method: str) -> None:
    """A band is present while the limit of its joint holds a task. It is above the joint's number for the upper limit, else below it."""
    lab = Lab([Limits()])
    lab.set("method", method)
    start, targets = lab.q, lab.targets
    lab.drag("tip", [0.5, 1.6, 0.0])
    run(lab, 1.0)
    law = al.PriorityVelocity(
        lab.system.arm,
        [al.Task("link4", "xy", [0.5, 1.6], 4.0), al.Task("link2", "xy", targets["elbow"][:2], 4.0)],
        method,  # type: ignore[arg-type]
        v_max=[9.0, 0.5, 9.0, 9.0],
    )
    same = al.simulate(al.VelocityArm(lab.system.arm), law, start, t_end=62 * FRAME, dt=1e-3)
    assert np.abs(lab.q - same.q[-1]).max() < 1e-9 and same.active
    t, *bands = lab.panels()[2]
    drawn = np.zeros((4, len(t)))
    for hold in same.active:
        during = (t > hold.start - 1e-9) & (t < hold.end - 1e-9)
        drawn[int(hold.name[-1]) - 1, during] = 0.4 if hold.side == "upper" else -0.4
    # The last record of a run has the bounds of that time.
    np.testing.assert_allclose(np.array(bands)[:, :-1] - np.arange(1.0, 5.0)[:, None], drawn[:, :-1], rtol=0.0, atol=1e-12)
    assert (drawn[1] != 0.0).any()
    _, *speeds = lab.panels()[1]
    assert np.abs(speeds[1]).max() <= 0.5 + 1e-12 and np.allclose(speeds[4:], [[0.5], [-0.5]])
