"""Arms with many joints for the benchmarks: a chain, and a trunk with branches. Link masses decrease towards the tip."""

from __future__ import annotations

from typing import Any

import armlet as al

LENGTH, THICKNESS = 0.12, 0.06  # length and thickness of a link, m
AXES = ("0 0 1", "0 1 0", "1 0 0")


def mass(level: int) -> float:
    """Mass of a link that has `level` links before it, kg."""
    return 2.0 * 0.93**level


def chain(n: int) -> al.Arm:
    """A chain of `n` revolute joints whose axes alternate between z, y and x. Links are 0.12 m long."""
    joints: list[dict[str, Any]] = []
    for i in range(n):
        m, c = mass(i), LENGTH / 2
        along, across = m * THICKNESS**2 / 6, m * (LENGTH**2 + THICKNESS**2) / 12 + m * c**2
        phi = [m, 0.0, 0.0, m * c, across, 0.0, across, 0.0, 0.0, along]
        axis = [float(x) for x in AXES[i % 3].split()]
        joints.append({"type": "R", "axis": axis, "rpy": [0.0, 0.0, 0.0], "xyz": [0.0, 0.0, LENGTH if i else 0.0], "phi": phi})
    return al.Arm.from_chain(joints)


def branched(trunk: int, branches: tuple[int, int]) -> al.Arm:
    """A tree of `trunk` joints with branches at its end; `branches` is (number of branches, joints of each)."""
    parts = ['<robot name="tree"><link name="base"/>']

    def link(name: str, parent: str, level: int, turn: float) -> str:
        m = mass(level)
        across, along = m * (LENGTH**2 + THICKNESS**2) / 12, m * THICKNESS**2 / 6
        parts.append(
            f'<link name="{name}"><inertial><origin xyz="0 0 {LENGTH / 2}"/><mass value="{m}"/>'
            f'<inertia ixx="{across}" iyy="{across}" izz="{along}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="to_{name}" type="continuous"><parent link="{parent}"/><child link="{name}"/>'
            f'<origin xyz="0 0 {LENGTH}" rpy="{turn} 0 0"/><axis xyz="{AXES[level % 3]}"/></joint>'
        )
        return name

    at = "base"
    for level in range(trunk):
        at = link(f"trunk{level + 1}", at, level, 0.0)
    for branch in range(branches[0]):
        end = at
        for level in range(branches[1]):
            # The first joints of the branches have different angles.
            end = link(f"branch{branch + 1}_{level + 1}", end, trunk + level, 0.4 * (branch + 1) if level == 0 else 0.0)
    return al.load_urdf("".join(parts) + "</robot>")
