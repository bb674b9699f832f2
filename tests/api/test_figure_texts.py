"""In every figure that the package can draw, no texts overlap, nothing is cut off, and every axis has a unit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
from boxes import faults
from matplotlib.figure import Figure
from test_figures import DRAWN

import armlet as al

SEVEN = models.SEVEN_AXES
SIX = models.SIX_AXES
PR = models.PR
Q = np.array([0.2, 0.6, 0.1, -1.3, 0.2, 0.9, 0.3])
SHORT: dict[str, Any] = {"t_end": 0.1, "dt": 1e-3}


def run(law: Any, q0: Any, plant: Any = None, **keywords: Any) -> al.Run:
    return al.simulate(al.RigidArm(law.arm) if plant is None else plant, law, q0, **SHORT | keywords)


def priority() -> al.Run:
    here = SEVEN.pose_vector(Q, "tcp")
    tasks = [al.Task("tcp", "xyz", here[:3] + 0.01, 2.0), al.Task("tcp", "rx ry", here[3:5], 2.0), al.PostureTask(Q, 1.0)]
    return run(al.PriorityVelocity(SEVEN, tasks), Q, al.VelocityArm(SEVEN))


def limited() -> al.Run:
    """A target out of reach, with the limits of the file: many bounds hold both levels."""
    tasks = [al.Task("tcp", "xyz", [2.0, 0.5, 0.3], 5.0), al.PostureTask([0.0] * 7, 1.0)]
    law = al.PriorityVelocity(SEVEN, tasks, limits=True)
    return run(law, Q, al.VelocityArm(SEVEN), t_end=1.0, dt=0.01, sample_time=0.01)


def impedance(axes: str, **keywords: Any) -> al.Run:
    rows = SEVEN.pose_vector(Q, "tcp")[: 3 if axes == "xyz" else 6]
    return run(al.CartesianImpedance(SEVEN, rows, 400.0, 40.0, frame="tcp", axes=axes, integral_gain=100.0), Q + 0.02, **keywords)


def adaptive(arm: al.Arm, **keywords: Any) -> al.Run:
    n = arm.n
    law = al.Adaptive(arm, al.Sinusoid([0.1] * n, [0.3] * n, [2.0] * n, [0.0] * n), 20.0, 5.0, 0.1, **keywords)
    return run(law, [0.0] * n)


def named(length: int) -> al.Arm:
    """An arm of seven joints with names of this length."""
    body = {
        "type": "R",
        "axis": [0, 0, 1],
        "xyz": [0.3, 0, 0],
        "phi": [1, 0, 0, 0, 1, 0, 1, 0, 0, 1],
        "effort": 90.0,
        "upper": 9.0,
        "lower": -7.0,
    }
    return al.Arm.from_chain([body | {"name": f"joint_{'x' * (length - 7)}{i}"} for i in range(7)])


def elastic() -> al.Run:
    law = al.ElasticImpedance(models.TWO_LINKS, [0.5, 0.5], 300.0, 40.0, 800.0, 0.3, 0.02, frame="link2", axes="xy")
    return run(law, [0.3, 1.2], al.ElasticArm(models.TWO_LINKS, 800.0, 0.3), dt=1e-4)


def wall() -> al.Run:
    law = al.CartesianImpedance(models.TWO_LINKS, [0.75, 0.2], 300.0, 40.0, frame="link2", axes="xy")
    return run(law, [0.8, 1.2], al.RigidArm(models.TWO_LINKS, wall=al.Wall("link2", [0.7, 0.0, 0.0], [-2.0, 0.0, 0.0], stiffness=1e3)))


def sensitivity(n: int, name: str) -> Any:
    arm = al.planar_arm([0.3] * n)
    law = al.PDGravity(arm, [0.1] * n, [1.0] * n, 0.5)
    made = al.simulate(al.RigidArm(arm), law, [0.0] * n, t_end=0.1, method="dop853", sensitivity=[name]).sensitivity
    assert made is not None
    return made[name]


def pid() -> al.Run:
    return run(al.PID(PR, [0.1, 0.2], 20.0, 10.0, 5.0), [0.0, 0.0])


def paths() -> Callable[[Figure], object]:
    from armlet.figures.time_path import PathTiming

    body = {"type": "P", "axis": [1, 0, 0], "phi": [1, 0, 0, 0, 1, 0, 1, 0, 0, 1]}
    arm = al.Arm.from_chain([body, body | {"type": "R", "axis": [0, 0, 1]}])
    limits = {"tau_max": [20.0, 20.0], "v_max": 4.0, "a_max": 9.0}
    return PathTiming(arm, al.time_path(arm, [[0.0, 0.0], [0.4, 0.5], [1.0, 0.5]], **limits), **limits).plot  # type: ignore[arg-type]


def log() -> al.Log:
    return al.read_log(run(al.ComputedTorque(SIX, al.Quintic([0.0] * 6, [0.5] * 6, 0.1), 400.0, 40.0), [0.0] * 6))


#: A figure per name. Each function draws into the figure that it is passed.
FIGURES: dict[str, Callable[[Figure], object]] = {
    **{name: draw for name, (_, draw) in DRAWN.items()},
    "levels of priority": lambda fig: priority().plot(fig),
    "levels with active bounds": lambda fig: limited().plot(fig),
    "a Cartesian law with forces": lambda fig: impedance("xyz").plot(fig),
    "a Cartesian law with forces and torques": lambda fig: impedance("xyz rx ry rz").plot(fig),
    "an adaptive law of a small arm": lambda fig: adaptive(PR).plot(fig),
    "an adaptive law of a large arm": lambda fig: adaptive(al.planar_arm([0.5] * 4), friction=True, armature=True).plot(fig),
    "a tracking law": lambda fig: run(al.ComputedTorque(SIX, al.Quintic([0.0] * 6, [0.5] * 6, 2.0), 400.0, 40.0), [0.0] * 6).plot(fig),
    "joints with long names": lambda fig: run(al.PDGravity(named(31), [0.1] * 7, 20.0, 5.0), [0.0] * 7).plot(fig),
    "joints with short names": lambda fig: run(al.PDGravity(named(8), [0.1] * 7, 20.0, 5.0), [0.0] * 7).plot(fig),
    "an arm of twelve joints": lambda fig: run(al.PDGravity(al.planar_arm([0.1] * 12), [0.1] * 12, 1.0, 0.1), [0.0] * 12, dt=1e-4).plot(
        fig
    ),
    "an integral of two units": lambda fig: pid().plot(fig),
    "elastic joints": lambda fig: elastic().plot(fig),
    "a wall": lambda fig: wall().plot(fig),
    "runs of seven joints": lambda fig: al.compare([impedance("xyz"), impedance("xyz", t_end=0.2)], ["first", "second"], fig=fig),
    "derivatives of four joints": lambda fig: sensitivity(4, "law.kp").plot(fig),
    "derivatives by the initial state": lambda fig: sensitivity(2, "q0").plot(fig),
    "a path of a slide and a turning joint": lambda fig: paths()(fig),
    "a log": lambda fig: log().plot(fig),
}


@pytest.mark.parametrize("name", FIGURES)
def test_texts_of_a_figure(name: str) -> None:
    figure = Figure()
    FIGURES[name](figure)
    assert faults(figure) == []


def test_faults_are_detected() -> None:
    figure = Figure(figsize=(4.0, 3.0), layout="constrained")
    ax = figure.subplots()
    ax.plot([0.0, 1.0], [0.0, 1.0])
    assert faults(figure) == ["no unit: x axis '' of ''", "no unit: y axis '' of ''"]
    ax.set(xlabel="time (s)", ylabel="angle (rad)")
    assert faults(figure) == []
    ax.text(0.5, 0.5, "one")
    ax.text(0.52, 0.5, "two")
    figure.text(0.9, 0.5, "beyond the edge")
    assert faults(figure) == ["overlap: 'one' and 'two'", "cut off: 'beyond the edge'"]
