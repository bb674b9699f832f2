"""Joint paths along poses against the reference, which takes plain Newton steps at many places of a separate curve."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet import reference as ref

PLACES = np.linspace(0.0, 1.0, 161)
JOINTS = [
    {"type": "R", "axis": axis, "rpy": [0, 0, 0], "xyz": xyz, "phi": [1.0] + [0.0] * 9}
    for axis, xyz in (
        ([0, 0, 1], [0, 0, 0.3]),
        ([0, 1, 0], [0.1, 0, 0.1]),
        ([0, 1, 0], [0, 0, 0.5]),
        ([1, 0, 0], [0.2, 0, 0.05]),
        ([0, 1, 0], [0.3, 0, 0]),
        ([1, 0, 0], [0.1, 0, 0]),
    )
]
START = np.array([0.2, 0.4, -0.3, 0.3, 0.8, -0.4])


def poses(rng: np.random.Generator, arm: al.Arm, count: int) -> np.ndarray:
    """Return poses (count, 4, 4) of nearby configurations, so that the arm can move between them."""
    q = START + np.concatenate([np.zeros((1, 6)), rng.uniform(-0.25, 0.25, (count - 1, 6))])
    return np.asarray(arm.pose(q, "link6"))


@pytest.mark.parametrize("options", [{}, {"blend": 0.03}, {"kind": "spline"}, {"arcs": [1]}, {"arcs": [1], "blend": 0.03}], ids=str)
@pytest.mark.parametrize("tolerance", [1e-4, [1e-6, 1e-5]], ids=["wide", "tight"])
def test_cartesian_path(options: dict[str, Any], tolerance: Any) -> None:
    """The tip stays within `tolerance` of the reference's curve.

    The joints stay within `tolerance` divided by the smallest singular value of the Jacobian.
    """
    rng = np.random.default_rng(11)
    arm, checker = al.Arm.from_chain(JOINTS), ref.Arm.from_chain(JOINTS)
    for count in (3, 4, 5) if "arcs" in options else (2, 3, 4):
        given = poses(rng, arm, count)
        path = al.cartesian_path(arm, given, START, frame="link6", tolerance=tolerance, **options)
        assert isinstance(path, al.CartesianPath) and path.feasible, path.reason
        metres, radians = np.broadcast_to(tolerance, 2)
        assert np.all(path.error <= [metres, radians])
        q = path(PLACES)[0]
        curve = ref.cartesian_curve(given, PLACES, options.get("kind", "lines"), options.get("blend", 0.0), options.get("arcs", ()))
        for (p, R), pose in zip(curve, checker.pose(q, "link6"), strict=True):
            assert np.linalg.norm(pose[:3, 3] - p) <= metres + 1e-9
            # |R1 - R2| / sqrt(2) is twice the sine of half the angle between them, which is about the angle.
            assert np.linalg.norm(pose[:3, :3] - R) / np.sqrt(2.0) <= radians + 1e-8
        wanted = ref.cartesian_path(checker, given, START, PLACES, frame="link6", **options)
        smallest = np.linalg.svd(checker.jacobian(q, "link6"), compute_uv=False)[:, -1].min()
        assert np.abs(q - wanted).max() <= 2.0 * np.hypot(metres, radians) / smallest


@pytest.mark.parametrize("turn", [0.3, 0.5, 0.8, 1.0])
def test_a_circle(turn: float) -> None:
    """The tip follows a circle through given points at a constant rate of the angle.

    The third point is `turn` of a full turn after the first. At 0.5 it is opposite to the first. At 1.0 the circle consists of two arcs.
    """
    arm = al.planar_arm([0.5, 0.4, 0.2])
    angles = np.linspace(0.0, turn * 2.0 * np.pi, 3 if turn < 1.0 else 5)
    centre, radius = np.array([0.5, 0.3]), 0.15
    rows = centre + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    arcs = list(range(1, angles.size, 2))
    path = al.cartesian_path(arm, rows, [-0.5, 1.0, 0.4], frame="link3", axes="xy", arcs=arcs, tolerance=1e-6)
    assert path.feasible and path.length == pytest.approx(2.0 * np.pi * turn * radius, rel=1e-12)
    apart = arm.position(path(PLACES)[0], "link3")[:, :2] - centre
    assert np.abs(np.linalg.norm(apart, axis=1) - radius).max() <= 1e-6
    got = np.unwrap(np.arctan2(apart[:, 1], apart[:, 0]))
    np.testing.assert_allclose(got, PLACES * turn * 2.0 * np.pi, rtol=0.0, atol=1e-6 / radius)


def test_lines_and_arcs() -> None:
    """A slot of two lines and two half circles: joint velocities do not jump, since neighbouring tangents agree."""
    arm = models.TWO_LINKS
    rows = [[0.4, 0.2], [0.6, 0.2], [0.7, 0.3], [0.6, 0.4], [0.4, 0.4], [0.3, 0.3], [0.4, 0.2]]
    path = al.cartesian_path(arm, rows, [-0.5, 1.4], frame="link2", axes="xy", arcs=[2, 5], tolerance=1e-6)
    assert path.feasible and path.length == pytest.approx(2 * 0.2 + 2 * np.pi * 0.1, rel=1e-12)
    x, y = arm.position(path(PLACES)[0], "link2")[:, :2].T
    outside = np.hypot(np.maximum(np.abs(x - 0.5) - 0.1, 0.0), y - 0.3)
    assert np.abs(outside - 0.1).max() <= 1e-6
    slope = path(np.linspace(0.0, 1.0, 2001))[1]
    assert np.abs(np.diff(slope, axis=0)).max() <= 0.05 * np.abs(slope).max()
    np.testing.assert_allclose(arm.position(path.q[path.corners], "link2")[:, :2], rows, rtol=0.0, atol=1e-8)


def test_rows() -> None:
    """A path with two task rows, x and y, of a planar arm agrees with the reference."""
    arm, checker = models.TWO_LINKS, models.REFERENCE_TWO_LINKS
    ends, start = np.array([[0.6, 0.0], [0.3, 0.5]]), np.array([-0.5, 1.0])
    matrices = np.tile(np.eye(4), (2, 1, 1))
    matrices[:, :2, 3] = ends
    path = al.cartesian_path(arm, ends, start, frame="link2", axes="xy", tolerance=1e-6)
    wanted = ref.cartesian_path(checker, matrices, start, PLACES, frame="link2", rows=[0, 1])
    np.testing.assert_allclose(path(PLACES)[0], wanted, rtol=0.0, atol=1e-5)


LIMITED = """<robot name="two"><link name="base"/>
<link name="upper"><inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
<link name="lower"><inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
<link name="tip"/>
<joint name="one" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="9" velocity="9"/></joint>
<joint name="two" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
<limit lower="0.2" upper="1.2" effort="9" velocity="9"/></joint>
<joint name="end" type="fixed"><parent link="lower"/><child link="tip"/><origin xyz="0.4 0 0"/></joint></robot>"""


def test_a_joint_at_its_limit() -> None:
    """The path ends where joint 2 of the reference passes its limit of 1.2 rad. With `limits=False` the path is feasible."""
    arm, checker = al.load_urdf(LIMITED), models.REFERENCE_TWO_LINKS
    ends, start = np.array([[0.8, 0.0], [0.4, 0.0]]), np.array([-0.3, 0.7])
    matrices = np.tile(np.eye(4), (2, 1, 1))
    matrices[:, :2, 3] = ends
    path = al.cartesian_path(arm, ends, start, frame="tip", axes="xy")
    wanted = ref.cartesian_path(checker, matrices, start, PLACES, frame="link2", rows=[0, 1])[:, 1]
    assert not path.feasible and (path.shortfall["kind"], path.shortfall["joint"]) == ("limit", 1)
    assert path.shortfall["s"] == pytest.approx(np.interp(1.2, wanted, PLACES), abs=1e-3)
    assert al.cartesian_path(arm, ends, start, frame="tip", axes="xy", limits=False).feasible


def test_out_of_reach() -> None:
    """Both paths end where the line crosses the circle of radius 0.9 m, the reach of the arm."""
    arm, checker = models.TWO_LINKS, models.REFERENCE_TWO_LINKS
    path = al.cartesian_path(arm, [[0.6, 0.0], [1.2, 0.0]], [-0.5, 1.0], frame="link2", axes="xy")
    assert not path.feasible and path.shortfall["kind"] == "unreachable"
    assert path.shortfall["s"] == pytest.approx(0.5, abs=1e-4) and path.shortfall["length"] == pytest.approx(0.3, abs=1e-4)
    matrices = np.tile(np.eye(4), (2, 1, 1))
    matrices[:, 0, 3] = 0.6, 1.2
    wanted = ref.cartesian_path(checker, matrices, [-0.5, 1.0], PLACES, frame="link2", rows=[0, 1])
    assert np.isfinite(wanted[PLACES < 0.49]).all() and np.isnan(wanted[PLACES > 0.51]).all()
