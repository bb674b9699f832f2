"""Pages that run the loops of the theory pages in the browser, and the links to them.

`python docs/live_loops.py FOLDER` writes the pages. As an extension of Sphinx, this file adds a link to each page of `LOOPS`, at the end of
its example. A reader on a code host sees no link, because the repository has no such pages.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

Loop = tuple[Any, Any, dict[str, Any], dict[str, tuple[float, float]], str]


def _adaptive() -> Loop:
    arm = al.planar_pr(A=2.0, B=0.5, C=0.5)
    motion = al.Sinusoid(offset=[0.0, 0.3], amplitude=[0.5, 0.8], frequency=[3.0, 2.0], phase=[0.0, 0.0])
    law = al.Adaptive(arm, motion, kp=[40.0, 20.0], kd=[20.0, 10.0], gamma=5.0)
    controls = {"law.gamma": (0.5, 50.0), "law.kd[0]": (5.0, 60.0), "law.kd[1]": (2.0, 30.0), "arm.parameters[0]": (1.0, 5.0)}
    return al.RigidArm(arm), law, {"q0": [0.2, -0.3]}, controls, "Change the gains or the mass A, and see the Lyapunov function"


def _impedance() -> Loop:
    arm = al.load_urdf(al.example_urdf("seven_axis"))
    q0 = np.array([0.2, 0.6, 0.1, -1.3, 0.2, 0.9, 0.3])
    better = al.NullSpace(np.add(q0, [0.5, -0.2, -0.6, 0.2, 0.3, 0.2, -0.4]), stiffness=30.0, damping=12.0)
    law = al.CartesianImpedance(arm, arm.position(q0, "tcp"), 400.0, 40.0, frame="tcp", axes="xyz", nullspace=better)
    controls = {"law.stiffness": (50.0, 1000.0), "law.damping": (10.0, 150.0)}
    return al.RigidArm(arm), law, {"q0": q0}, controls, "Change the stiffness, and drag the target of the tip"


def _elastic() -> Loop:
    arm = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0])
    springs, motors = np.array([800.0, 500.0]), np.array([0.4, 0.25])
    target = arm.position([0.3, 1.2], "link2")[:2]
    law = al.ElasticImpedance(arm, target, [300.0, 200.0], [40.0, 30.0], springs, motors, motors / 20, frame="link2", axes="xy")
    controls = {"law.stiffness[0]": (50.0, 600.0), "law.stiffness[1]": (50.0, 600.0)}
    return al.ElasticArm(arm, springs, motors), law, {"q0": [0.1, 1.4], "dt": 5e-4}, controls, "Drag the target, and change its stiffness"


def _priority() -> Loop:
    arm = al.planar_arm([1.0, 1.0, 0.25, 0.25])
    tasks = [al.Task("link4", "xy", [1.7, 0.9], 4.0), al.Task("link2", "xy", [1.5, 0.6], 4.0)]
    law = al.PriorityVelocity(arm, tasks, "clamp", eps=0.02)
    controls = {"law.tasks.0.gain": (0.2, 20.0), "law.tasks.1.gain": (0.2, 20.0), "law.eps": (0.001, 0.5)}
    text = "Drag a target out of reach, and see which task still reaches its target"
    return al.VelocityArm(arm), law, {"q0": [0.9, -1.2, 0.6, 0.7]}, controls, text


def _lift(q0: float, gravity_moment: float, tau_max: float, text: str) -> Loop:
    """A link of 1 kg m^2 that a motor turns by half a turn, with the fastest of the symmetric profiles."""
    start, mass = q0 + np.pi / 2, 1.0  # rad from the downward vertical, kg
    com = gravity_moment / (mass * 9.81)
    arm = al.planar_arm([0.5], masses=[mass], coms=[com], inertias=[1.0 - mass * com**2])
    found = al.bang_bang_time(start, start + np.pi, 1.0, gravity_moment, tau_max)
    law = al.ComputedTorque(arm, al.BangBang([q0], [q0 + np.pi], found.t_min), 100.0, 20.0)
    options = {"q0": [q0], "tau_max": tau_max}
    # arm.parameters[1] is the product of mass and distance of the centre of mass.
    return al.RigidArm(arm), law, options, {"arm.parameters[1]": (0.0, 3.0 * tau_max / 9.81), "law.kp": (1.0, 400.0)}, text


def _minimum_time() -> Loop:
    text = "Increase the first moment, the mass times the distance of its centre from the joint, until the motor is too weak"
    return _lift(-np.pi / 2, 1.0, 2.0, text)


def _exercise_4() -> Loop:
    text = "Increase the first moment, the gravity moment divided by 9.81 m/s^2, above the torque limit of 1 N m"
    return _lift(-np.pi, 0.5, 1.0, text)


def _friction() -> Loop:
    arm = al.planar_arm([0.5], masses=[1.0], coms=[0.25], inertias=[0.4375], gravity=[0.0, 0.0])
    friction = al.StickSlip(coulomb=1.0, static=2.0, stribeck_speed=0.05)
    law = al.PID(arm, [1.0], kp=10.0, ki=10.0, kd=3.0)
    controls = {"law.kp": (5.0, 50.0), "law.ki": (1.0, 30.0), "law.kd": (1.0, 30.0), "plant.friction.static": (1.1, 3.0)}
    text = "The integral pulls the joint past its target again and again. Decrease the static friction until this ends"
    return al.RigidArm(arm, friction=friction), law, {"q0": [0.0]}, controls, text


#: For each file: its loop, and the text of the link.
LOOPS: dict[str, Callable[[], Loop]] = {
    "adaptive": _adaptive,
    "impedance": _impedance,
    "elastic": _elastic,
    "priority": _priority,
    "minimum_time": _minimum_time,
    "friction": _friction,
    "exercise_4": _exercise_4,
}

#: The loops of the exercises of the exam, in their order.
EXERCISES = ("adaptive", "priority", "elastic", "exercise_4")


def write(folder: Path) -> None:
    """Write the page of each loop."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in LOOPS.items():
        plant, law, options, controls, _ = make()
        al.export_web((plant, law), folder / f"{name}.html", controls, **options)


def link(name: str) -> str:
    """Return the paragraph with the link to a loop."""
    return f'\n<p><a href="loops/{name}.html">Run this loop in the browser.</a> {LOOPS[name]()[-1]}.</p>\n'


def linked(name: str, page: str) -> str:
    """Return the text of a page with a link to its loop before its second heading. In the exam, each exercise has a link."""
    if name == "exam":
        for k, loop in enumerate(EXERCISES, 1):
            at = page.index("\n", page.index(f"\n## Exercise {k}:") + 1) + 1
            page = page[:at] + link(loop) + page[at:]
        return page
    first = page.find("\n## ")
    at = page.find("\n## ", first + 1)
    return page[:at] + link(name) + page[at:]


def setup(app: Any) -> dict[str, Any]:
    def add_link(_: Any, name: str, source: list[str]) -> None:
        if name == "exam" or name in LOOPS:
            source[0] = linked(name, source[0])

    app.connect("source-read", add_link)
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    write(Path(sys.argv[1]))
