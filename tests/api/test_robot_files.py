"""Robot files: packages by `package://`, xacro files by the package `xacro`, groups and poses of SRDF."""

from __future__ import annotations

import os
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armlet as al

TEXT = al.example_urdf("planar_2r")
ARM = al.load_urdf(TEXT)


@pytest.fixture(autouse=True)
def no_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)


def package(folder: Path, name: str = "my_robot", text: str = TEXT, file: str = "urdf/robot.urdf") -> Path:
    path = folder / name / file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return folder / name


class TestPackages:
    @pytest.mark.parametrize("at", ["the package", "its folder", "the folder of that"])
    def test_a_package_is_found(self, tmp_path: Path, at: str) -> None:
        own = package(tmp_path / "src" / "repository")
        folder = {"the package": own, "its folder": own.parent, "the folder of that": own.parent.parent}[at]
        for search_path in (folder, str(folder), [tmp_path, folder]):
            assert al.load_urdf("package://my_robot/urdf/robot.urdf", search_path=search_path) == ARM

    def test_the_environment_is_searched(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        package(tmp_path / "ros")
        package(tmp_path / "install" / "share", "other")
        monkeypatch.setenv("ROS_PACKAGE_PATH", os.pathsep.join([str(tmp_path / "absent"), str(tmp_path / "ros"), ""]))
        monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
        for name in ("my_robot", "other"):
            assert al.load_urdf(f"package://{name}/urdf/robot.urdf") == ARM
        # Folders of the caller are searched first.
        heavy = TEXT.replace('name="planar_2r"', 'name="first"')
        package(tmp_path / "mine", text=heavy)
        assert al.load_urdf("package://my_robot/urdf/robot.urdf", search_path=tmp_path / "mine") == al.load_urdf(heavy)

    @pytest.mark.parametrize("rest", ["../secret.urdf", "urdf/../../secret.urdf", "out.urdf", "away/secret.urdf"])
    def test_nothing_leads_out(self, tmp_path: Path, rest: str) -> None:
        own = package(tmp_path / "src")
        outside = package(tmp_path / "elsewhere", "robot", file="secret.urdf")
        (own.parent / "secret.urdf").symlink_to(outside / "secret.urdf")
        (own / "out.urdf").symlink_to(outside / "secret.urdf")
        (own / "away").symlink_to(outside)
        with pytest.raises(al.InputError, match=r"path_or_xml leads out of its package: expected a file inside"):
            al.load_urdf(f"package://my_robot/{rest}", search_path=own)
        # A symbolic link from the package into a folder of `search_path` is allowed, because workspaces link installed files to sources.
        assert al.load_urdf("package://my_robot/out.urdf", search_path=[own, outside]) == ARM

    @pytest.mark.parametrize(
        ("source", "words"),
        [
            ("package://my_robot/none.urdf", "path_or_xml is not in its package: expected a file in .*my_robot"),
            ("package://absent/robot.urdf", "package 'absent' is not found: expected a folder of that name in"),
            ("package://*/robot.urdf", r"package '\*' is not found"),
            ("package://my_robot", "path_or_xml names no file: expected package://name/file"),
            ("package:///robot.urdf", "path_or_xml names no file"),
            ("package://../robot.urdf", "path_or_xml names no file"),
            ("https://a.b/robot.urdf", "path_or_xml has an unknown scheme: expected a path or package://name/file"),
            ("package://my_robot/urdf", "path_or_xml cannot be read: expected a URDF file or its text"),
        ],
    )
    def test_missing_files_and_packages_are_named(self, tmp_path: Path, source: str, words: str) -> None:
        package(tmp_path)
        with pytest.raises(al.InputError, match=f"^load_urdf: {words}"):
            al.load_urdf(source, search_path=tmp_path)

    @pytest.mark.parametrize(
        ("search_path", "words"),
        [
            (3, "search_path is of the wrong type: expected a folder or a list of folders, got 3"),
            ([".", 3], r"search_path\[1\] is of the wrong type: expected a path, got 3"),
            (["nowhere"], r"search_path\[0\] is no folder: expected one that holds packages, got nowhere"),
            ("a\0b", r"search_path\[0\] cannot be opened"),
        ],
    )
    def test_a_wrong_search_path_is_refused(self, search_path: Any, words: str) -> None:
        with pytest.raises(al.InputError, match=f"^load_urdf: {words}"):
            al.load_urdf("package://a/b", search_path=search_path)
        with pytest.raises(al.InputError, match=f"^load_urdf: {words}"):
            al.load_urdf(TEXT, search_path=search_path)

    def test_a_scenario_takes_packages(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        package(tmp_path)
        monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
        law = {"kind": "PDGravity", "target": [0.1, 0.2], "kp": 10.0, "kd": 5.0}
        run = {"q0": [0.0, 0.0], "t_end": 0.1, "dt": 0.01}
        scenario = al.Scenario({"arm": {"kind": "urdf", "path": "package://my_robot/urdf/robot.urdf"}, "law": law, "run": run})
        assert scenario.build().plant.arm == ARM
        alone = scenario.standalone()
        monkeypatch.delenv("ROS_PACKAGE_PATH")
        assert alone.build().plant.arm == ARM


XACRO = """<?xml version="1.0"?>
<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="mass" default="2.0"/>
  <xacro:include filename="$(find my_robot)/urdf/link.xacro"/>
  <link name="base"/>
  <xacro:body name="arm" mass="$(arg mass)"/>
  <joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 ${2 - 1}"/></joint>
</robot>"""
MACRO = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="body" params="name mass">
<link name="${name}"><inertial><mass value="${mass}"/>
<inertia ixx="0.1" iyy="0.1" izz="${0.1 * mass}" ixy="0" ixz="0" iyz="0"/></inertial></link>
</xacro:macro></robot>"""


class TestXacro:
    @pytest.fixture
    def folder(self, tmp_path: Path) -> Path:
        package(tmp_path, text=XACRO, file="urdf/robot.urdf.xacro")
        return package(tmp_path, text=MACRO, file="urdf/link.xacro")

    def test_a_file_is_expanded(self, folder: Path) -> None:
        path = folder / "urdf" / "robot.urdf.xacro"
        for source in (path, str(path), "package://my_robot/urdf/robot.urdf.xacro"):
            arm = al.load_urdf(source, search_path=folder)
            assert arm.joint_names == ("hinge",) and arm.parameters[[0, 9]].tolist() == [2.0, 0.2]
        for mass in ("4", 4, 4.0):
            assert al.load_urdf(path, search_path=folder, xacro_arguments={"mass": mass}).parameters[0] == 4.0

    def test_errors_of_xacro_are_reported(self, folder: Path) -> None:
        path = folder / "urdf" / "robot.urdf.xacro"
        with pytest.raises(al.InputError, match=r"^load_urdf: path_or_xml is refused by xacro: .*package 'my_robot' is not found"):
            al.load_urdf(path)
        for text, words in (("<robot", "ExpatError"), (XACRO.replace("${2 - 1}", "${2 - one}"), "name .one. is not defined")):
            path.write_text(text)
            with pytest.raises(al.InputError, match=f"is refused by xacro: .*{words}"):
                al.load_urdf(path, search_path=folder)
        # Other users of xacro still find their packages.
        import xacro.substitution_args

        assert xacro.substitution_args._eval_find.__module__ == "xacro.substitution_args"

    def test_expanded_files_are_checked_like_other_texts(self, folder: Path) -> None:
        path = folder / "urdf" / "robot.urdf.xacro"
        with pytest.raises(al.ModelError, match=r"mass of link arm is negative: got -1") as caught:
            al.load_urdf(path, search_path=folder, xacro_arguments={"mass": -1})
        assert caught.value.file == str(path)

    def test_wrong_arguments_are_refused(self, folder: Path, tmp_path: Path) -> None:
        path = folder / "urdf" / "robot.urdf.xacro"
        for arguments, words in (
            (["mass"], "xacro_arguments is of the wrong type: expected values by name"),
            ({"mass": None}, "xacro_arguments holds what is no argument: expected names with texts, numbers or flags, got 'mass': None"),
            ({3: "a"}, "xacro_arguments holds what is no argument"),
        ):
            with pytest.raises(al.InputError, match=f"^load_urdf: {words}"):
                al.load_urdf(path, search_path=folder, xacro_arguments=arguments)  # type: ignore[arg-type]
        plain = package(tmp_path, "plain") / "urdf" / "robot.urdf"
        for source in (TEXT, plain):
            with pytest.raises(al.InputError, match=r"xacro_arguments is not used: expected None for what is no .xacro file"):
                al.load_urdf(source, xacro_arguments={"mass": 1})
        with pytest.raises(al.InputError, match=r"path_or_xml cannot be read: expected a URDF file or its text, got .*none.xacro"):
            al.load_urdf(tmp_path / "none.xacro")

    def test_without_xacro_the_error_names_the_package(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "xacro", None)
        with pytest.raises(
            ImportError, match=r"^load_urdf: xacro is not installed: pip install '\.\[xacro\]' in the folder of armlet's sources$"
        ):
            al.load_urdf(folder / "urdf" / "robot.urdf.xacro")
        with pytest.raises(al.ModelError, match=r"this is a xacro file: load_urdf expands \*.xacro"):
            al.load_urdf(XACRO)


SRDF = """<?xml version="1.0"?>
<robot name="six_axis">
  <!-- As MoveIt writes it. -->
  <group name="arm"><chain base_link="base" tip_link="flange"/></group>
  <group name="joints"><joint name="joint2"/><joint name="joint3"/><joint name="no_such_joint"/></group>
  <group name="links"><link name="link3"/><link name="link4"/></group>
  <group name="both"><group name="joints"/><group name="links"/></group>
  <group name="apart"><joint name="joint1"/><joint name="joint4"/></group>
  <group name="chains"><chain base_link="base" tip_link="link2"/><chain base_link="link2" tip_link="link4"/></group>
  <group name="circle"><group name="circle"/><joint name="joint1"/></group>
  <group name="nothing"/>
  <group_state name="home" group="arm"><joint name="joint1" value="0.1"/><joint name="joint3" value="-1.2e0"/></group_state>
  <group_state name="home" group="joints"><joint name="joint2" value="0.5"/></group_state>
  <group_state name="up" group="arm"><joint name="joint2" value="0.7"/></group_state>
  <virtual_joint name="fixed" type="fixed" parent_frame="world" child_link="base"/>
  <disable_collisions link1="a" link2="b" reason="Never"/>
</robot>"""
SIX = al.example_urdf("six_axis")


class TestSrdf:
    srdf = al.load_srdf(SRDF)
    arm = al.load_urdf(SIX)

    def test_groups_and_poses_of_a_file(self, tmp_path: Path) -> None:
        assert self.srdf.name == "six_axis" and self.srdf.groups["arm"].chains == (("base", "flange"),)
        assert self.srdf.groups["both"].joints == ("joint2", "joint3", "no_such_joint") and self.srdf.groups["both"].links == (
            "link3",
            "link4",
        )
        assert self.srdf.states["arm", "home"] == {"joint1": 0.1, "joint3": -1.2}
        path = package(tmp_path, text=SRDF, file="robot.srdf") / "robot.srdf"
        assert al.load_srdf(path) == al.load_srdf(str(path)) == self.srdf == pickle.loads(pickle.dumps(self.srdf))

    @pytest.mark.parametrize(
        ("group", "ends"),
        [
            ("arm", ("base", "flange")),
            ("joints", ("link1", "link3")),
            ("links", ("link2", "link4")),
            ("both", ("link1", "link4")),
            ("chains", ("base", "link4")),
            ("circle", ("base", "link1")),
        ],
    )
    def test_a_group_is_a_chain_of_the_robot(self, group: str, ends: tuple[str, str]) -> None:
        root, tip = ends
        assert self.srdf.arm(SIX, group) == al.load_urdf(SIX, root=root, tip=tip)
        assert self.srdf.arm(SIX, group, gravity=(0, 0, 0)) == al.load_urdf(SIX, root=root, tip=tip, gravity=(0, 0, 0))

    def test_poses_by_name(self) -> None:
        assert self.srdf.pose(self.arm, "up").tolist() == [0.0, 0.7, 0.0, 0.0, 0.0, 0.0]
        assert self.srdf.pose(self.arm, "home", group="arm").tolist() == [0.1, 0.0, -1.2, 0.0, 0.0, 0.0]
        rest = np.arange(6.0)
        assert self.srdf.pose(self.arm, "up", otherwise=rest).tolist() == [0.0, 0.7, 2.0, 3.0, 4.0, 5.0] and rest[1] == 1.0
        assert self.srdf.pose(self.srdf.arm(SIX, "joints"), "home", group="joints").tolist() == [0.5, 0.0]

    def test_wrong_calls_are_refused(self) -> None:
        srdf, arm = self.srdf, self.arm
        for call, words in (
            (lambda: srdf.arm(SIX, "leg"), "Srdf.arm: group is unknown: expected one of arm, joints"),
            (lambda: srdf.arm(SIX, "apart"), "Srdf.arm: group apart is not one chain: .*got joint1, joint4"),
            (lambda: srdf.arm(SIX, "nothing"), "Srdf.arm: group nothing is not one chain: .*got none of them"),
            (lambda: srdf.arm(SIX, "arm", tip="link2"), "Srdf.arm: tip is not used"),
            (lambda: srdf.arm(TEXT, "links"), "group links is not one chain"),
            (lambda: srdf.arm("nowhere.urdf", "links"), "Srdf.arm: source cannot be read"),
            (lambda: srdf.arm(3, "links"), "Srdf.arm: source is of the wrong type"),  # type: ignore[arg-type]
            (lambda: srdf.pose(arm, "down"), "Srdf.pose: state is unknown: expected one of home, up"),
            (lambda: srdf.pose(arm, "home"), "Srdf.pose: group is missing: expected one of arm, joints"),
            (lambda: srdf.pose(arm, "up", group="joints"), "Srdf.pose: group is unknown: expected one of arm"),
            (lambda: srdf.pose(al.pendulum(1.0, 1.0), "up"), "Srdf.pose: arm has no joint of the pose"),
            (lambda: srdf.pose(arm, "up", otherwise=[1.0]), r"otherwise has the wrong shape"),
            (lambda: srdf.pose(arm, "up", otherwise=np.nan), "otherwise is not finite"),
            (lambda: srdf.pose(SIX, "up"), "Srdf.pose: arm is of the wrong type"),  # type: ignore[arg-type]
        ):
            with pytest.raises(al.InputError, match=words):
                call()

    @pytest.mark.parametrize("group", ["arm", "joints", "links"])
    def test_a_damaged_robot_is_a_model_error(self, group: str) -> None:
        with pytest.raises(al.ModelError, match=r"^Srdf\.arm: source|^load_urdf: "):
            self.srdf.arm("<robot", group)

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("<robot", "not well formed"),
            ("<sdf/>", "has the wrong root: expected <robot>, got <sdf>"),
            ("<!DOCTYPE robot [<!ENTITY a 'b'>]><robot name='&a;'/>", "declares a document type"),
            ("<robot><group/></robot>", "has a <group> without name"),
            ("<robot><group name='a'/><group name='a'/></robot>", "names a group twice"),
            ("<robot><group name='a'><chain base_link='b'/></group></robot>", "has a <chain> without tip_link"),
            ("<robot><group name='a'><group name='b'/></group></robot>", "has an unknown group in group 'a': expected a, got 'b'"),
            ("<robot><group_state name='a' group='b'/></robot>", "has a pose 'a' of an unknown group: expected none, got 'b'"),
            (
                "<robot><group name='g'/><group_state name='a' group='g'><joint name='j' value='nan'/></group_state></robot>",
                "a value that is no number: expected one, got 'nan' .joint 'j' of pose 'a'.",
            ),
        ],
    )
    def test_damaged_files_are_refused(self, text: str, words: str) -> None:
        with pytest.raises(al.InputError, match=f"^load_srdf: .*{words}"):
            al.load_srdf(text)

    def test_files_that_cannot_be_read_are_refused(self, tmp_path: Path) -> None:
        (tmp_path / "binary.srdf").write_bytes(b"\xff\xfe\x00")
        for source in (tmp_path, tmp_path / "none.srdf", tmp_path / "binary.srdf"):
            with pytest.raises(al.InputError, match=r"^load_srdf: path_or_xml cannot be read: expected a file or its text"):
                al.load_srdf(source)
        with pytest.raises(al.InputError, match=r"^load_srdf: path_or_xml is of the wrong type"):
            al.load_srdf(3)  # type: ignore[arg-type]
        large = tmp_path / "large.srdf"
        large.write_text("<robot>" + " " * (16 << 20) + "</robot>")
        with pytest.raises(al.InputError, match=r"^load_srdf: path_or_xml is too large"):
            al.load_srdf(large)


def prefixed(limit: str, more: str) -> str:
    """A robot with one joint. `limit` and `more` are added to its limit and to the file."""
    return f"""<robot name='r'>
<link name='a'/>
<link name='drake:b'><inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link>
<joint name='j' type='revolute'><parent link='a'/><child link='drake:b'/><axis xyz='0 0 1'/>
<limit {limit} lower='-1' upper='1' effort='2' velocity='3'/></joint>
<!-- <drake:x> -->{more}</robot>"""


def test_prefixes_without_a_declaration() -> None:
    """Other URDF readers accept names with undeclared prefixes.

    A colon in a quoted text is kept, and elements are reported with their line.
    """
    plain = al.load_urdf(prefixed("", ""))
    arm = al.load_urdf(prefixed("drake:acceleration='2.5' old:x=\"drake:y\"", "<drake:joint name='k'><drake:member/></drake:joint>"))
    assert arm.n == 1 and "drake:b" in arm.frame_names and arm.limits["v_max"] == plain.limits["v_max"]
    np.testing.assert_array_equal(arm.parameters, plain.parameters)
    assert [line for line in arm.report if "drake" in line] == ["dropped: drake.joint of robot (1, first in line 6)"]
    with pytest.raises(al.ModelError, match=r":6: "):
        al.load_urdf(prefixed("drake:a='1'", "<joint name='k'/>"))
    # A file with many different prefixes is refused, and so is a file of xacro that is not expanded.
    with pytest.raises(al.ModelError, match="unknown namespace prefix"):
        al.load_urdf(prefixed("", "".join(f"<p{i}:x/>" for i in range(20))))
    with pytest.raises(al.ModelError, match="xacro"):
        al.load_urdf(prefixed("xacro:a='1'", ""))
    for broken in ("<a drake:b", "<drake:", "<robot drake:x='", "<!-- drake:", "<robot drake:"):
        with pytest.raises(al.ModelError):
            al.load_urdf(broken)
