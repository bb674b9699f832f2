"""Inverse kinematics of other libraries on the cases of bench_priority.py: pink and mink (a weighted QP) and placo (hard and soft tasks).

These libraries take target poses, not velocities. A target `dt` ahead of the present pose gives the same velocity. A weighted QP has no
strict priority. Its result is comparable if all tasks are feasible (4R, 2 + 2). If the last task conflicts (seven axes, 3 + 3 + 7), the
result is comparable up to the weight of that task.
"""

from __future__ import annotations

import importlib.util
import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

DT = 1e-6
#: Cost of the last task, relative to the cost of the other tasks. The error of a weighted QP is proportional to its square.
SOFT = 1e-3
Call = Callable[[], Any]


def planar_urdf(lengths: Any) -> str:
    """The URDF of `planar_arm`, with a frame at the tip of each link."""
    inertial = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    parts, parent, reach = ['<robot name="planar"><link name="base"/>'], "base", 0.0
    for i, length in enumerate(lengths, 1):
        axis = '<axis xyz="0 0 1"/><limit lower="-9" upper="9" velocity="99" effort="99"/>'
        parts.append(f'<link name="body{i}">{inertial}</link><joint name="joint{i}" type="revolute"><parent link="{parent}"/>')
        parts.append(f'<child link="body{i}"/><origin xyz="{reach} 0 0"/>{axis}</joint>')
        # The tip has a mass, so that readers do not merge it with its link.
        parts.append(f'<link name="link{i}">{inertial}</link><joint name="tip{i}" type="fixed"><parent link="body{i}"/>')
        parts.append(f'<child link="link{i}"/><origin xyz="{length} 0 0"/></joint>')
        parent, reach = f"body{i}", length
    return "".join([*parts, "</robot>"])


class Problem:
    """An arm at `q` and its tasks `(frame, axes, velocity)` with axes "xy", "xyz" or "rx ry rz".

    `posture` is a velocity of all joints, the last task.
    """

    def __init__(self, urdf: str, q: Any, tasks: list[tuple[str, str, Any]], posture: Any | None = None) -> None:
        self.urdf, self.q, self.tasks, self.posture = urdf, np.asarray(q, dtype=float), tasks, posture


def _moved(rotation: Any, position: Any, axes: str, velocity: Any) -> tuple[Any, Any]:
    """The pose after the time DT at this velocity."""
    step = np.zeros(3)
    step[: len(velocity)] = DT * np.asarray(velocity)
    if not axes.startswith("r"):
        return rotation, position + step
    angle = float(np.linalg.norm(step))
    x, y, z = step / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return (np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K) @ rotation, position


def pink(problem: Problem) -> Call:
    import pinocchio as pin
    from pink import Configuration, solve_ik
    from pink.tasks import FrameTask, PostureTask

    model = pin.buildModelFromXML(problem.urdf)
    configuration = Configuration(model, model.createData(), problem.q)
    tasks: list[Any] = []
    for frame, axes, velocity in problem.tasks:
        turn = axes.startswith("r")
        task = FrameTask(frame, position_cost=0.0 if turn else 1.0, orientation_cost=1.0 if turn else 0.0)
        at = configuration.get_transform_frame_to_world(frame)
        task.set_target(pin.SE3(*_moved(at.rotation, at.translation, axes, velocity)))
        tasks.append(task)
    if problem.posture is not None:
        rest = PostureTask(cost=SOFT)
        rest.set_target(problem.q + DT * problem.posture)
        tasks.append(rest)

    def call() -> Any:
        configuration.update(problem.q)
        return solve_ik(configuration, tasks, DT, solver="daqp", limits=())

    return call


def mink(problem: Problem) -> Call:
    import mink as mk
    import mujoco

    model = mujoco.MjModel.from_xml_string(re.sub("(<robot[^>]*>)", rf"\1{FUSE}", problem.urdf, count=1))
    configuration = mk.Configuration(model, problem.q)
    tasks: list[Any] = []
    for frame, axes, velocity in problem.tasks:
        turn = axes.startswith("r")
        task = mk.FrameTask(frame, "body", position_cost=0.0 if turn else 1.0, orientation_cost=1.0 if turn else 0.0)
        at = configuration.get_transform_frame_to_world(frame, "body")
        rotation, position = _moved(at.rotation().as_matrix(), at.translation(), axes, velocity)
        task.set_target(mk.SE3.from_rotation_and_translation(mk.SO3.from_matrix(rotation), position))
        tasks.append(task)
    if problem.posture is not None:
        rest = mk.PostureTask(model, cost=SOFT)
        rest.set_target(problem.q + DT * problem.posture)
        tasks.append(rest)

    def call() -> Any:
        configuration.update(problem.q)
        return mk.solve_ik(configuration, tasks, DT, solver="daqp", limits=[])

    return call


#: MuJoCo merges a body without a joint into its parent unless `fusestatic` is "false".
FUSE = '<mujoco><compiler fusestatic="false" strippath="true" discardvisual="true"/></mujoco>'


def placo(problem: Problem) -> Call:
    import placo as pl

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "arm.urdf")
        path.write_text(problem.urdf)
        robot = pl.RobotWrapper(str(path), pl.Flags.ignore_collisions)
    solver = pl.KinematicsSolver(robot)
    solver.mask_fbase(True)
    solver.enable_joint_limits(False)
    solver.enable_velocity_limits(False)
    robot.state.q[7:] = problem.q
    robot.update_kinematics()
    for k, (frame, axes, velocity) in enumerate(problem.tasks):
        at = robot.get_T_world_frame(frame)
        rotation, position = _moved(at[:3, :3], at[:3, 3], axes, velocity)
        if axes.startswith("r"):
            task = solver.add_orientation_task(frame, rotation)
        else:
            task = solver.add_position_task(frame, position)
            task.mask.set_axises(axes, "task")
        task.configure(f"task{k}", "hard" if k == 0 else "soft", 1.0)
    if problem.posture is not None:
        rest = solver.add_joints_task()
        names = list(robot.joint_names())
        rest.set_joints(dict(zip(names, problem.q + DT * problem.posture, strict=True)))
        # placo adds a regularisation. A smaller weight of this task would be hidden by it.
        rest.configure("rest", "soft", 1e-4)

    def call() -> Any:
        robot.update_kinematics()
        return solver.solve(False)[6:] / DT

    return call


PEERS: dict[str, Callable[[Problem], Call]] = {"pink": pink, "mink": mink, "placo": placo}


def installed() -> dict[str, Callable[[Problem], Call]]:
    return {name: make for name, make in PEERS.items() if importlib.util.find_spec(name) is not None}
