"""Shapes that the viewer draws: the geometry of the robot's file, or capsules and spheres where the file has none.

No content of a file raises an error.
"""

from __future__ import annotations

from pathlib import Path

import models
import numpy as np
import pytest

import armlet as al
from armlet.live.shapes import between, planar_links
from armlet.live.urdf import find_mesh, missing_line, read_shapes

JOINT = """<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""


def robot(visual: str) -> str:
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    blue = '<material name="blue"><color rgba="0 0 1 1"/></material>'
    return f'<robot name="r">{blue}<link name="base"/><link name="arm">{inertial}{visual}</link>{JOINT}</robot>'


def of_arm(text: str | Path) -> list:  # type: ignore[type-arg]
    return [shape for shape in read_shapes(text, al.load_urdf(text)).shapes if shape.frame == "arm"]


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
    # armlet's URDF reader applies the same `rpy` to a fixed joint.
    fixed = robot("").replace(
        "</robot>", f'<link name="tip"/><joint name="f" type="fixed"><parent link="arm"/><child link="tip"/>{origin}</joint></robot>'
    )
    arm = al.load_urdf(fixed)
    expected = np.linalg.inv(arm.pose([0.0], "arm")) @ arm.pose([0.0], "tip")
    assert np.abs(shape.pose - expected).max() < 1e-15
    # The last link has geometry, so the viewer adds no sphere.
    whole = fixed.replace("</inertial>", f"</inertial><visual><geometry>{geometry}</geometry></visual>", 1)
    assert [made.frame for made in read_shapes(whole, al.load_urdf(whole)).shapes if made.kind != "capsule"] == ["arm"]


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
    shapes = read_shapes(text, al.load_urdf(text)).shapes
    assert [(shape.frame, shape.kind) for shape in shapes] == [("base", "capsule"), ("arm", "sphere")]
    # The capsule extends from the base to the joint at a height of 0.4 m.
    assert shapes[0].size[1] == pytest.approx(0.4) and shapes[0].pose[:3, 3] == pytest.approx([0.0, 0.0, 0.2])


def test_collision_shapes_are_used_if_visuals_are_missing() -> None:
    ball, mesh = '<sphere radius="0.07"/>', '<mesh filename="none.stl"/>'
    both = "<visual><geometry>{}</geometry></visual><collision><geometry>{}</geometry></collision>"
    (shape,) = of_arm(robot(both.format(mesh, ball)))
    assert (shape.kind, shape.size) == ("sphere", (0.07,))
    (shape,) = of_arm(robot(both.format(ball, '<box size="1 1 1"/>')))
    assert shape.kind == "sphere"


def test_text_that_only_one_parser_reads() -> None:
    arm = al.load_urdf(robot(""))
    assert read_shapes("<robot><link></robot>", arm) == ([], ())


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Create a ROS package with meshes in its folders, and one mesh outside the package."""
    package = tmp_path / "my_robot"
    for folder in ("meshes", "urdf/beside", "urdf/my_robot"):
        (package / folder).mkdir(parents=True)
    for place in ("meshes/arm.STL", "urdf/own.stl", "urdf/beside/near.stl", "urdf/my_robot/named.stl", "../out.stl"):
        (package / place).write_bytes(b"solid\nendsolid\n")
    (package / "meshes" / "secret.txt").write_text("not a mesh")
    return package


def test_meshes_are_found(package: Path) -> None:
    """The search finds a mesh in the folder of the URDF file, or in a package folder that the caller names."""
    urdf = package / "urdf"
    for name in ("own.stl", "./own.stl", "beside/../own.stl", f"file://{urdf}/own.stl", f"{urdf}/own.stl", "package://my_robot/own.stl"):
        found = find_mesh(name, [urdf])
        assert found is not None and found.samefile(urdf / "own.stl"), name
    assert find_mesh("package://any/beside/near.stl", [urdf]) == (urdf / "beside" / "near.stl").resolve()
    assert find_mesh("model://my_robot/named.stl", [urdf]) == (urdf / "my_robot" / "named.stl").resolve()
    mesh = package / "meshes" / "arm.STL"
    for name in ("package://my_robot/meshes/arm.STL", "model://my_robot/meshes/arm.STL", "../meshes/arm.STL", f"file://{mesh}"):
        assert find_mesh(name, [urdf]) is None, name
        for given in ([urdf, package], [urdf, package.parent]):
            found = find_mesh(name, given)
            assert found is not None and found.samefile(mesh), name
    file = urdf / "r.urdf"
    file.write_text(
        robot('<visual><geometry><mesh filename="package://my_robot/meshes/arm.STL" scale="0.001 0.001 0.001"/></geometry></visual>')
    )
    arm = al.load_urdf(file)
    (shape,) = [shape for shape in read_shapes(file, arm, [package]).shapes if shape.frame == "arm"]
    assert (shape.kind, shape.size) == ("mesh", (0.001, 0.001, 0.001)) and Path(shape.path).samefile(mesh)
    looks = read_shapes(file, arm)
    assert looks.missing == ("package://my_robot/meshes/arm.STL",) and all(shape.kind != "mesh" for shape in looks.shapes)
    assert "--package" in missing_line(looks.missing) and missing_line(()) == ""


def test_meshes_outside_are_not_opened(package: Path) -> None:
    """The search returns None for a mesh outside its folders: by `..`, absolute path, `file://` or symbolic link.

    No file name raises an error.
    """
    urdf, out = package / "urdf", package.parent / "out.stl"
    (urdf / "link.stl").symlink_to(out)
    (urdf / "round.stl").symlink_to(urdf / "round.stl")
    (urdf / "up").symlink_to(package.parent)
    (urdf / "twin.stl").symlink_to(urdf / "own.stl")
    (urdf / "folder.stl").mkdir()
    names = ["../../out.stl", str(out), f"file://{out}", "link.stl", "up/out.stl", "package://../../out.stl", "package://x/../../out.stl"]
    names += [
        f"package://x/{out}",
        f"package://{out}",
        "file://../../out.stl",
        "beside/../../../out.stl",
        "package://my_robot/../../../out.stl",
    ]
    names += ["", "package://", "file://", "../meshes/secret.txt", "http://host/own.stl", "none.stl", "round.stl", "folder.stl", "a\0b.stl"]
    names += ["x" * 5000 + ".stl", "package:/own.stl", "package://x"]
    for name in names:
        for given in ([urdf], [urdf, package / "meshes"]):
            assert find_mesh(name, given) is None, name
    found = find_mesh("twin.stl", [urdf])
    assert found is not None and found.samefile(urdf / "own.stl")
    # A robot passed as text has no folder to search.
    visual = f'<visual><geometry><mesh filename="{urdf}/own.stl"/></geometry></visual>'
    text = robot(visual)
    assert read_shapes(text, al.load_urdf(text)).missing == (f"{urdf}/own.stl",)


def test_a_late_declaration_does_not_hide_the_looks(tmp_path: Path) -> None:
    text = robot('<visual><geometry><sphere radius="0.07"/></geometry></visual>')
    for before in ("", "\n", "<!-- mine -->\n", "\ufeff"):
        for given in (before + '<?xml version="1.0" encoding="utf-8"?>' + text, tmp_path / "r.urdf"):
            if isinstance(given, Path):
                given.write_text(before + '<?xml version="1.0" encoding="utf-8"?>' + text, encoding="utf-8")
            assert [shape.kind for shape in of_arm(given)] == ["sphere"], repr(before)


@pytest.mark.parametrize("name", ["planar_2r", "planar_pr", "macro_micro_4r", "six_axis", "seven_axis", "two_arms"])
def test_every_moving_link_is_drawn(name: str) -> None:
    text = al.example_urdf(name)
    arm = al.load_urdf(text)
    shapes = read_shapes(text, arm).shapes
    assert {shape.frame for shape in shapes} == set(arm.frame_names)
    # Each capsule ends at the origin of another frame, with prismatic joints at zero and revolute joints at 0.3 rad.
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
    arm = models.TWO_LINKS
    base, *links = planar_links(arm, [0.5, 0.4], 0.02)
    assert base.frame is None
    q, before = [0.7, -1.1], np.zeros(3)
    for shape in links:
        pose = arm.pose(q, shape.frame) @ shape.pose
        half = 0.5 * shape.size[1] * pose[:3, 2]
        assert np.abs(pose[:3, 3] - half - before).max() < 1e-15
        before = pose[:3, 3] + half
    assert np.abs(before - arm.position(q, "link2")).max() < 1e-15
