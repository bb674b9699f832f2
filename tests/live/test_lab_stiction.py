"""The link with static friction: under PD it stops before its goal, and under PID it oscillates about the goal."""

from __future__ import annotations

import numpy as np
import pytest

from armlet.live.model import FRAME, WINDOW, Lab
from armlet.live.systems import Stiction


def run(lab: Lab, seconds: float) -> None:
    for _ in range(round(seconds / FRAME)):
        lab.advance()


def test_the_link_stops_short_under_pd() -> None:
    lab = Lab([Stiction()])
    lab.set("ki", 0.0)
    run(lab, 6.0)
    angle, torque, speed = lab.panels()
    goal = angle[2][-1]
    # At rest the torque of the law is at most the breakaway torque, 2 N m, and the position error is not zero.
    assert speed[1][-1] == 0.0 and speed[2][-1] == 1.0
    assert 0.02 < abs(angle[1][-1] - goal) and abs(torque[1][-1]) < torque[2][-1] == 2.0
    lab.set("friction", "none")
    run(lab, 6.0)
    assert abs(lab.panels()[0][1][-1] - goal) < 1e-4


@pytest.mark.parametrize("friction", ["stick-slip", "LuGre"])
def test_the_link_hunts_under_pid(friction: str) -> None:
    lab = Lab([Stiction()])
    lab.set("friction", friction)
    run(lab, 6.0 + WINDOW)
    angle, _, speed = lab.panels()
    error = angle[1] - angle[2]
    assert np.ptp(error) > 0.05  # rad
    stuck = np.asarray(speed[2])
    assert 0.2 < stuck.mean() < 1.0 and np.abs(np.diff(stuck)).sum() >= 2.0


def test_the_bristles_stay_bent_when_a_slider_moves() -> None:
    lab = Lab([Stiction()])
    lab.set("friction", "LuGre")
    lab.set("ki", 0.0)
    run(lab, 6.0)
    at_rest = lab.q.copy()
    lab.set("kd", 5.0)
    run(lab, 0.5)
    # With bristles reset to zero deflection, the link would move by F / stiffness, at least 1e-4 rad.
    np.testing.assert_allclose(lab.q, at_rest, atol=2e-6)


def test_the_integral_continues_when_a_slider_moves() -> None:
    lab = Lab([Stiction()])
    lab.set("friction", "none")
    lab.set("ki", 30.0)
    run(lab, 1.0)
    before = lab.panels()[1][1][-1]
    lab.set("coulomb", 2.0)  # friction is off, so only the loop is new
    lab.advance(1e-3)
    after = lab.panels()[1][1][-1]
    _, angle, goal = lab.panels()[0]
    integral = 30.0 * np.trapezoid(goal - angle, dx=FRAME)  # N m
    # In one step of 1 ms the torque changes by less than 0.1 N m. A reset of the integral would change it by more than 1 N m.
    assert abs(after - before) < 0.1 and abs(integral) > 1.0
    # With K_i = 0 the integral is zero. It starts again from zero when K_i returns to 30.
    lab.set("ki", 0.0)
    run(lab, 5.0)
    assert abs(lab.panels()[1][1][-1]) < 1e-2 and abs(lab.panels()[0][1][-1] - lab.panels()[0][2][-1]) < 1e-3
    lab.set("ki", 30.0)
    run(lab, 1.0)
    assert abs(lab.panels()[1][1][-1]) < 1e-2
