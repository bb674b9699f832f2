"""Limits of zero and below in a robot file, given to functions that require positive limits. The errors name the joint and the file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import armlet as al


def robot(limit: str) -> al.Arm:
    """Two links. `limit` has the attributes of the second joint's limits."""
    body = '<inertial><origin xyz="0.2 0 0"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial>'
    text = f"""<robot><link name="b"/><link name="l1">{body}</link><link name="l2">{body}</link>
    <joint name="shoulder" type="revolute"><parent link="b"/><child link="l1"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="50" velocity="2"/></joint>
    <joint name="elbow" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" {limit}/></joint></robot>"""
    return al.load_urdf(text)


ZERO = [0.0, 0.0]
PATH = [[0.0, 0.0], [0.2, 0.2], [0.5, 0.1]]
EFFORT: dict[str, Callable[[al.Arm], Any]] = {
    "simulate": lambda arm: al.simulate(
        al.RigidArm(arm), al.PDGravity(arm, ZERO, 50.0, 5.0), ZERO, t_end=0.1, dt=1e-2, tau_max=arm.limits["effort"]
    ),
    "time_path": lambda arm: al.time_path(arm, PATH, tau_max=arm.limits["effort"]),
    "PID": lambda arm: al.PID(arm, al.Hold(ZERO), 50.0, 1.0, 5.0, tau_max=arm.limits["effort"]),
    "CartesianImpedance": lambda arm: al.CartesianImpedance(arm, [0.5], 100.0, 10.0, frame="l2", axes="x", tau_max=arm.limits["effort"]),
    "exciting_motion": lambda arm: al.exciting_motion(arm, 5.0, harmonics=1, iterations=2, limits={"a_max": 10.0}),
}
VELOCITY: dict[str, Callable[[al.Arm], Any]] = {
    "time_path": lambda arm: al.time_path(arm, PATH, a_max=5.0, v_max=arm.limits["v_max"]),
    "exciting_motion": EFFORT["exciting_motion"],
}


@pytest.mark.parametrize("value", ["0", "-3"])
@pytest.mark.parametrize("name", EFFORT)
def test_efforts(name: str, value: str) -> None:
    words = rf"elbow.* effort limit {value} in its file|elbow.* effort limit in its file is {value}"
    with pytest.raises(al.InputError, match=rf"^{name}: .*({words})"):
        EFFORT[name](robot(f'effort="{value}" velocity="2"'))


@pytest.mark.parametrize("value", ["0", "-3"])
@pytest.mark.parametrize("name", VELOCITY)
def test_velocities(name: str, value: str) -> None:
    words = rf"elbow.* velocity limit.* {value} in its file|elbow.* velocity limit in its file is {value}"
    with pytest.raises(al.InputError, match=rf"^{name}: .*({words})"):
        VELOCITY[name](robot(f'effort="50" velocity="{value}"'))


def test_a_negative_velocity_limit_with_priorities() -> None:
    level = al.Task("l2", "x", [0.3])
    with pytest.raises(al.InputError, match=r"joint elbow has the velocity limit -3 in its file"):
        al.PriorityVelocity(robot('effort="50" velocity="-3"'), [level], method="sns")


def test_the_limits_of_a_call_replace_those_of_the_file() -> None:
    arm = robot('effort="0" velocity="0"')
    motion = al.exciting_motion(arm, 5.0, harmonics=1, iterations=2, limits={"a_max": 10.0, "v_max": 1.5, "effort": 50.0})
    _, v, _ = motion(np.linspace(0.0, 5.0, 200))
    # The motion scales up to its limits, so some joint nearly reaches one.
    assert 0.1 < np.abs(v).max() <= 1.5
    with pytest.raises(al.InputError, match=r"tau_max is not positive: expected > 0, got 0 \(first bad index 0\)$"):
        al.simulate(al.RigidArm(arm), al.PDGravity(arm, ZERO, 50.0, 5.0), ZERO, t_end=0.1, dt=1e-2, tau_max=[0.0, 1.0])
