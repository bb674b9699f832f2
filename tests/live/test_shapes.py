"""What is drawn of a robot: the geometry of its file where it has some, plain links where not; nothing in a file stops it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import armlet as al
from armlet.live.shapes import between, planar_links
from armlet.live.urdf import find_mesh, read_shapes

JOINT = """<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""


def robot(visual: str) -> str:
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    blue = '<material name="blue"><color rgba="0 0 1 1"/></material>'
    return f'<robot name="r">{blue}<link name="base"/><link name="arm">{inertial}{visual}</link>{JOINT}</robot>'


def of_arm(text: str) -> list:  # type: ignore[type-arg]
    return [shape for shape in read_shapes(text, al.load_urdf(text)) if shape.frame == "arm"]


@pytest.mark.parametrize(
    ("geometry", "kind", "size"),
    [
        ('<box size="0.1 0.2 0.3"/>', "box", (0.1, 0.2, 0.3)),
        ('<cylinder radius="0.05" length="0.4"/>', "cylinder", (0.05, 0.4)),
        ('<sphere radius="0.07"/>', "sphere", (0.07,)),
    ],
)
def test_geometry_of_the_file(geometry: str, kind: str, size: tuple[float, ...]) -> None:
    origin = '<origin xyz="1 2 3" rpy="0.1 -0.4 2.0"/>'
    (shape,) = of_arm(robot(f'<visual>{origin}<geometry>{geometry}</geometry><material name="blue"/></visual>'))
    assert (shape.kind, shape.size, shape.colour) == (kind, size, (0, 0, 255))
    # The reader of the core turns a fixed joint by the same angles.
    fixed = robot("").replace(
        "</robot>", f'<link name="tip"/><joint name="f" type="fixed"><parent link="arm"/><child link="tip"/>{origin}</joint></robot>'
    )
    arm = al.load_urdf(fixed)
    expected = np.linalg.inv(arm.pose([0.0], "arm")) @ arm.pose([0.0], "tip")
    assert np.abs(shape.pose - expected).max() < 1e-15


@pytest.mark.parametrize(
    "visual",
    [
        "",
        "<visual/>",
        "<visual><geometry/></visual>",
        '<visual><geometry><box size="1 2"/></geometry></visual>',
        '<visual><geometry><box size="1 nan 2"/></geometry></visual>',
        '<visual><geometry><sphere radius="-1"/></geometry></visual>',
        '<visual><geometry><sphere radius="big"/></geometry></visual>',
        '<visual><geometry><torus radius="1"/></geometry></visual>',
        '<visual><geometry><mesh filename="package://nowhere/arm.stl"/></geometry></visual>',
        "<visual><geometry><mesh/></geometry></visual>",
    ],
)
def test_plain_links_stand_for_the_rest(visual: str) -> None:
    text = robot(visual)
    shapes = read_shapes(text, al.load_urdf(text))
    assert [(shape.frame, shape.kind) for shape in shapes] == [("base", "capsule"), ("arm", "sphere")]
    # From the base to the joint, 0.4 m up.
    assert shapes[0].size[1] == pytest.approx(0.4) and shapes[0].pose[:3, 3] == pytest.approx([0.0, 0.0, 0.2])


def test_meshes_are_found(tmp_path: Path) -> None:
    """Beside the file, below it, or in the package that a folder above it is."""
    package = tmp_path / "my_robot"
    (package / "meshes").mkdir(parents=True)
    (package / "urdf").mkdir()
    mesh = package / "meshes" / "arm.STL"
    mesh.write_bytes(b"solid\nendsolid\n")
    (package / "meshes" / "secret.txt").write_text("not a mesh")
    for name in ("package://my_robot/meshes/arm.STL", "model://my_robot/meshes/arm.STL", "../meshes/arm.STL", f"file://{mesh}"):
        found = find_mesh(name, package / "urdf")
        assert found is not None and found.samefile(mesh), name
    for name in ("", "package://", "package://my_robot/meshes/none.stl", "../meshes/secret.txt", "http://host/arm.stl", "arm.stl"):
        assert find_mesh(name, package / "urdf") is None, name
    file = package / "urdf" / "r.urdf"
    file.write_text(
        robot('<visual><geometry><mesh filename="package://my_robot/meshes/arm.STL" scale="0.001 0.001 0.001"/></geometry></visual>')
    )
    shape = read_shapes(file, al.load_urdf(file))[-1]
    assert (shape.kind, shape.size) == ("mesh", (0.001, 0.001, 0.001)) and Path(shape.path).samefile(mesh)


@pytest.mark.parametrize("name", ["planar_2r", "planar_pr", "macro_micro_4r", "six_axis", "seven_axis", "two_arms"])
def test_every_moving_link_is_drawn(name: str) -> None:
    text = al.example_urdf(name)
    arm = al.load_urdf(text)
    shapes = read_shapes(text, arm)
    assert {shape.frame for shape in shapes} == set(arm.frame_names)
    # Every capsule ends at the origin of another frame, where the joint between is at zero or turns.
    q = np.where([kind == "prismatic" for kind in arm.joint_types], 0.0, 0.3)
    origins = np.array([arm.position(q, frame) for frame in arm.frame_names])
    for shape in shapes:
        if shape.kind == "capsule":
            pose = arm.pose(q, shape.frame) @ shape.pose
            end = pose[:3, 3] + 0.5 * shape.size[1] * pose[:3, 2]
            assert np.linalg.norm(origins - end, axis=1).min() < 1e-12


@pytest.mark.parametrize("end", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.3, -0.4, 0.5), (1e-9, 0.0, 0.0)])
def test_capsules_go_from_end_to_end(end: tuple[float, float, float]) -> None:
    shape = between("f", (0.1, 0.2, 0.3), np.add((0.1, 0.2, 0.3), end), 0.01)
    R = shape.pose[:3, :3]
    assert np.abs(R.T @ R - np.eye(3)).max() < 1e-15 and np.linalg.det(R) > 0
    ends = [shape.pose[:3, 3] + sign * 0.5 * shape.size[1] * R[:, 2] for sign in (-1, 1)]
    assert np.abs(ends - np.add((0.1, 0.2, 0.3), [(0.0, 0.0, 0.0), end])).max() < 1e-15


def test_a_capsule_of_no_length() -> None:
    shape = between(None, (1.0, 2.0, 3.0), (1.0, 2.0, 3.0), 0.01)
    assert shape.size == (0.01, 0.0) and np.array_equal(shape.pose[:3, :3], np.eye(3))


def test_planar_links_reach_from_tip_to_tip() -> None:
    arm = al.planar_arm([0.5, 0.4])
    base, *links = planar_links(arm, [0.5, 0.4], 0.02)
    assert base.frame is None
    q, before = [0.7, -1.1], np.zeros(3)
    for shape in links:
        pose = arm.pose(q, shape.frame) @ shape.pose
        half = 0.5 * shape.size[1] * pose[:3, 2]
        assert np.abs(pose[:3, 3] - half - before).max() < 1e-15
        before = pose[:3, 3] + half
    assert np.abs(before - arm.position(q, "link2")).max() < 1e-15
