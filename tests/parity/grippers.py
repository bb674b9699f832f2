"""Arms with mimic joints, as a URDF text and as a list of joints."""

from __future__ import annotations

from typing import Any

import numpy as np
from trees import random_joints


def link(name: str, mass: float, com: str, inertia: float) -> str:
    """Return the URDF of a link with a full inertia tensor."""
    moments = f"ixx='{inertia}' iyy='{1.3 * inertia}' izz='{1.1 * inertia}' ixy='{0.1 * inertia}'"
    return (
        f"<link name='{name}'><inertial><origin xyz='{com}' rpy='0.1 0.2 0.3'/><mass value='{mass}'/><inertia {moments}/></inertial></link>"
    )


def joint(name: str, kind: str, parent: str, child: str, xyz: str, axis: str, more: str = "") -> str:
    """Return the URDF of a joint: limits -2 and 2, speed 3, effort 10, and friction and armature of its drive."""
    return (
        f"<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/><origin xyz='{xyz}' rpy='0.2 0 0.1'/>"
        f"<axis xyz='{axis}'/><limit lower='-2' upper='2' velocity='3' effort='10'/>"
        f"<dynamics damping='0.2' friction='0.1' armature='0.03'/>{more}</joint>"
    )


#: Two joints and a parallel gripper. The joint "right" mimics "left" with opposite sign. "turn_left" mimics "left", and "turn_right" mimics
#: "turn_left". "turn_right" precedes the joint that it mimics in the file.
GRIPPER = "<robot name='gripper'><link name='base'/>{}</robot>".format(
    "\n".join(
        [
            link("l1", 2.0, "0.1 0 0.2", 0.05),
            link("l2", 1.5, "0 0.1 0.2", 0.04),
            link("f1", 0.3, "0.02 0 0.05", 0.002),
            link("f2", 0.3, "-0.02 0 0.05", 0.002),
            link("k1", 0.2, "0 0.03 0.02", 0.001),
            link("k2", 0.2, "0 0.03 0.02", 0.001),
            joint("turn_right", "revolute", "f2", "k2", "0 0 0.1", "0 1 0", "<mimic joint='turn_left' multiplier='2' offset='-0.1'/>"),
            joint("turn_left", "revolute", "f1", "k1", "0 0 0.1", "1 0 0", "<mimic joint='left' multiplier='-1.5' offset='0.3'/>"),
            joint("shoulder", "revolute", "base", "l1", "0 0 0.3", "0 0 1"),
            joint("elbow", "revolute", "l1", "l2", "0 0 0.4", "0 1 0.2"),
            joint("right", "prismatic", "l2", "f2", "-0.05 0 0.3", "1 0 0", "<mimic joint='left' multiplier='-1'/>"),
            joint("left", "prismatic", "l2", "f1", "0.05 0 0.3", "1 0 0"),
        ]
    )
)


def following_joints(n: int, seed: int) -> list[dict[str, Any]]:
    """Return a random tree of `n + 3` moving joints, three of which mimic others. The third mimics the first mimic joint."""
    rng = np.random.default_rng([n, seed, 7])
    joints = random_joints(rng, n + 3)
    moving = [k for k, each in enumerate(joints) if each["type"] != "fixed"]
    order = [int(k) for k in rng.permutation(moving)]
    first, second, third, *rest = order
    for follower, leader in ((first, rest[0]), (second, rest[-1]), (third, first)):
        joints[follower]["mimic"] = {"joint": leader, "multiplier": float(rng.uniform(-2.0, 2.0)), "offset": float(rng.normal())}
    for k in moving:
        joints[k] |= {key: float(rng.uniform(0.0, 0.3)) for key in ("armature", "damping", "friction")}
        joints[k] |= {"lower": -3.0 - float(rng.random()), "upper": 3.0 + float(rng.random()), "velocity": 1.0 + float(rng.random())}
    return joints
