"""Arms from odd models: each is read with a word in `arm.report`, or refused with a typed error that says where."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armlet as al

INERTIA = '<inertia ixx="0.1" iyy="0.1" izz="0.1"/>'
LINK = f'<link name="l1"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>{INERTIA}</inertial></link>'


def joint(inner: str = "", kind: str = "revolute", axis: str = "0 0 1", name: str = "j1", parent: str = "base", child: str = "l1") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}<axis xyz="{axis}"/>{inner}</joint>\n'


def robot(body: str, link: str = LINK) -> str:
    return f'<robot name="r">\n<link name="base"/>\n{link}\n{body}</robot>'


ENTITIES = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'

REFUSED = {
    "axis zero": (robot(joint(axis="0 0 0")), 4, "axis of joint j1 is zero"),
    "axis short": (robot(joint(axis="0 1")), 4, "expected 3 numbers, got 2"),
    "axis NaN": (robot(joint(axis="0 0 nan")), 4, "not finite"),
    "negative mass": (robot(joint(), LINK.replace('value="1"', 'value="-1"')), 3, "mass of link l1 is negative"),
    "no mass": (robot(joint(), LINK.replace('<mass value="1"/>', "")), 3, "without mass"),
    "overflow": (robot(joint(), LINK.replace('value="1"', 'value="1e300"').replace("0.1 0 0", "1e10 0 0")), 4, "overflow"),
    "floating": (robot(joint(kind="floating")), 4, "has the type floating"),
    "planar": (robot(joint(kind="planar")), 4, "has the type planar"),
    "xacro": (robot("<xacro:property/>" + joint()), 4, "xacro robot.xacro > robot.urdf"),
    "limit NaN": (robot(joint('<limit lower="nan" upper="1"/>')), 4, "lower of limit is not finite"),
    "limit text": (robot(joint('<limit lower="${pi}" upper="1"/>')), 4, "lower of limit is not a number"),
    "second limit": (robot(joint("<limit/><limit/>")), 4, "second limit"),
    "entities": (ENTITIES + robot("<x>&b;</x>" + joint()), 1, "DTD"),
    "cycle": (robot(joint(parent="l2") + '<link name="l2"/>' + joint(name="j2", parent="l1", child="l2")), 4, "cycle"),
    "two parents": (robot(joint() + joint(name="j2")), 5, "child of two joints"),
    "duplicate link": (robot(joint() + LINK), 5, "duplicate"),
    "deep": (robot("<a>" * 5000 + "</a>" * 5000), 4, "nested too deeply"),
    "many attributes": (robot("<x " + " ".join(f'a{i}="1"' for i in range(1000)) + "/>"), 4, "too many attributes"),
    "html": ("<html/>", 1, "expected the root element robot"),
    "cut short": (robot(joint())[:60], 1, "well-formed"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_arm_is_refused_with_its_line(name: str, tmp_path: Path) -> None:
    text, line, problem = REFUSED[name]
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    for given in (text, str(path), path):
        with pytest.raises(al.ModelError) as caught:
            al.load_urdf(given)
        assert problem in str(caught.value) and caught.value.line == line
        assert caught.value.file == ("<string>" if given is text else str(path))


REPORTED = {
    "mimic": (robot(joint('<mimic joint="jx" multiplier="2"/>')), "line 4: joint j1 mimics jx: kept as an independent joint"),
    "limits crossed": (robot(joint('<limit lower="2" upper="-2"/>')), "line 4: joint j1 has its lower limit 2 above its upper limit -2"),
    "negative velocity": (robot(joint('<limit velocity="-3"/>')), "line 4: joint j1 has a negative velocity limit: -3"),
    "negative effort": (robot(joint('<limit effort="-1"/>')), "line 4: joint j1 has a negative effort limit: -1"),
    "negative damping": (robot(joint('<dynamics damping="-1"/>')), "line 4: joint j1 has negative damping: -1"),
    "no inertial": (robot(joint(), '<link name="l1"/>'), "zero mass: the bodies moved by j1"),
    "meshes": (robot(joint(), '<link name="l1"><visual/></link>'), "dropped: visual of link (1, first in line 3)"),
    "no rigid body": (robot(joint(), LINK.replace('ixx="0.1"', 'ixx="9"')), "line 3: inertia of link l1 is no rigid body's"),
}


@pytest.mark.parametrize("name", REPORTED)
def test_what_is_odd_is_kept_and_reported(name: str) -> None:
    text, said = REPORTED[name]
    arm = al.load_urdf(text)
    assert arm.n == 1 and any(line.startswith(said) for line in arm.report), arm.report
    again = al.load_urdf(arm.to_urdf()[0])
    assert again.joint_names == arm.joint_names and np.array_equal(again.parameters, arm.parameters)


def test_spellings_of_one_robot_are_one_arm(tmp_path: Path) -> None:
    plain = al.load_urdf(robot(joint()))
    path = tmp_path / "robot with a space.urdf"
    path.write_bytes(b"\xef\xbb\xbf" + robot(joint()).replace("\n", "\r\n").encode())
    given: list[Any] = [
        "\ufeff" + robot(joint()),
        "\n  " + robot(joint()),
        path,
        robot("<!-- <joint> -->" + joint()),
        robot(joint(axis="0 0 7")),
        robot(joint(axis="+0 -0 1e-320")),
        robot(joint(axis="0 0 1e308")),
    ]
    for other in given:
        arm = al.load_urdf(other)
        assert arm.joint_names == plain.joint_names
        assert np.array_equal(arm.mass_matrix([0.3]), plain.mass_matrix([0.3])), other
    named = al.load_urdf(robot(joint(name="joint one").replace("l1", "link one"), LINK.replace("l1", "link one")))
    assert named.joint_names == ("joint one",) and "link one" in named.frame_names


@pytest.mark.parametrize("least, accepted", [(-0.9e-7, True), (-1.2e-7, False)])
def test_printed_digits_of_small_inertias_are_forgiven(least: float, accepted: bool) -> None:
    """Files print seven or eight decimals: a principal moment of -1e-7 kg m^2 is rounding, more is not."""
    small = LINK.replace('value="1"', 'value="1e-6"').replace(INERTIA, f'<inertia ixx="{least}" iyy="1e-6" izz="1e-6"/>')
    if not accepted:
        with pytest.raises(al.ModelError, match="negative principal moment") as caught:
            al.load_urdf(robot(joint(), small))
        assert caught.value.line == 3
        return
    arm = al.load_urdf(robot(joint(), small))
    assert any("triangle inequality" in line for line in arm.report)
    assert not arm.check_parameters()


@pytest.mark.parametrize("shape", ["chain", "star"])
def test_twenty_thousand_joints_load_from_python(shape: str) -> None:
    """Room for answers of n^2 numbers is not made before they are asked for."""
    count = 20_000
    parents = range(count) if shape == "chain" else [0] * count
    each = enumerate(parents, start=1)
    links = "".join(f'<link name="l{i}"/>{joint(name=f"j{i}", parent=f"l{parent}", child=f"l{i}")}' for i, parent in each)
    start = time.perf_counter()
    arm = al.load_urdf(f'<robot><link name="l0"/>{links}</robot>')
    # A second on a quiet machine; five leave room for a busy one.
    assert time.perf_counter() - start < 5.0
    assert arm.n == count and np.all(arm.gravity(np.zeros(count)) == 0.0)
    assert arm.position(np.zeros(count), f"l{count}").shape == (3,)


def test_constructors_refuse_what_means_nothing() -> None:
    with pytest.raises(al.InputError, match=r"joints is empty: expected at least one joint"):
        al.Arm.from_chain([])
    with pytest.raises(al.InputError, match=r"rows is empty: expected at least one row"):
        al.Arm.from_dh([])
    row = {"a": 1.0, "alpha": 0.0, "d": 0.0, "theta": 0.0}
    for key in ("offset", "Theta", 3):
        with pytest.raises(al.InputError, match=rf"rows\[1\] has an unknown key: expected one of type, a, .*, got {key!r}"):
            al.Arm.from_dh([row, row | {key: 1.0}])
    for kind in ("X", "fixed", 3, None):
        with pytest.raises(al.InputError, match=r'rows\[0\]\["type"\] is unknown'):
            al.Arm.from_dh([row | {"type": kind}])
    with pytest.raises(al.InputError, match=r'joints\[0\]\["axis"\] is not a list: expected 3 numbers'):
        al.Arm.from_chain([{"type": "R", "axis": 5}])
    with pytest.raises(al.InputError, match=r'joints\[0\]\["name"\] is not a name'):
        al.Arm.from_chain([{"type": "R", "name": 3}])
    for name, given in {"lengths": [0.5, -0.1], "masses": [1.0, -1.0], "inertias": [0.1, -0.1]}.items():
        with pytest.raises(al.InputError, match=rf"{name} is negative: expected >= 0, got -.* \(first bad index 1\)"):
            al.planar_arm(**({"lengths": [0.5, 0.5]} | {name: given}))
    # A link of length zero puts two axes on one another; a centre of mass may lie behind the joint.
    arm = al.planar_arm([0.0, 0.5], masses=[1.0, 1.0], inertias=[0.1, 0.1], coms=[-0.1, 0.2])
    np.testing.assert_array_equal(arm.position([0.0, 0.0], "link2"), [0.5, 0.0, 0.0])


def test_the_argument_that_is_not_finite_is_named_by_its_index() -> None:
    arm = al.load_urdf(al.example_urdf("six_axis"))
    q, v, a = np.zeros((3, 40, 6))
    v[33, 4] = np.inf
    out = np.full((40, 6), 7.0)
    options: list[dict[str, Any]] = [{}, {"out": out}]
    for given in options:
        with pytest.raises(al.InputError, match=r"v is not finite: expected finite numbers, got inf \(first bad index \(33, 4\)\)"):
            arm.inverse_dynamics(q, v, a, **given)
    assert np.all(out == 7.0)
    bad = np.zeros((4096, 6))
    bad[4000, 2] = np.nan
    with pytest.raises(al.InputError, match=r"q is not finite: .* \(first bad index \(4000, 2\)\)"):
        arm.regressor(bad, bad, bad, bad)
    with pytest.raises(al.InputError, match=r"v is not finite: .* \(first bad index \(0, 1\)\)"):
        al.planar_pr(2.0, 0.5, 0.5).bias([0.0, 0.0], [[0.0, np.nan]])


def test_energies_are_written_where_the_caller_says() -> None:
    arm = al.load_urdf(al.example_urdf("six_axis"))
    q, v = np.random.default_rng(1).uniform(-1.0, 1.0, (2, 5, 6))
    kinetic, potential = arm.energy(q, v)
    np.testing.assert_allclose(kinetic, 0.5 * np.einsum("ki,kij,kj->k", v, arm.mass_matrix(q), v), rtol=1e-13)
    out = (np.empty(5), np.empty(5))
    given = arm.energy(q, v, out=out)
    assert given[0] is out[0] and given[1] is out[1]
    np.testing.assert_array_equal(out, (kinetic, potential))
    with pytest.raises(al.InputError, match="out"):
        arm.energy(q, v, out=(out[0], out[0]))
    with pytest.raises(al.InputError, match="out"):
        arm.energy(q, v, out=out[0])  # type: ignore[arg-type]


CHANGES = {
    "load mass": (lambda arm: arm.with_payload("link1", "heavy"), "Arm.with_payload: mass is not a number"),
    "load centre": (lambda arm: arm.with_payload("link1", 1.0, [0.0, 0.0]), r"Arm.with_payload: com has the wrong shape: expected \(3,\)"),
    "load centre NaN": (lambda arm: arm.with_payload("link1", 1.0, [0.0, 0.0, np.nan]), "com is not finite.*index 2"),
    "load inertia": (lambda arm: arm.with_payload("link1", 1.0, inertia=np.eye(2)), r"inertia has the wrong shape: expected \(3, 3\), got"),
    "frame place": (lambda arm: arm.with_frame("tip", "link1", xyz=1.0), "Arm.with_frame: xyz has the wrong shape"),
    "frame turn": (lambda arm: arm.with_frame("tip", "link1", rpy=["a", "b", "c"]), "rpy is not an array of real numbers"),
    "lock where": (lambda arm: arm.locked({"joint1": "up"}), r'Arm.locked: joints\["joint1"\] is not a number'),
    "lock what": (lambda arm: arm.locked({1: 0.0}), "Arm.locked: joints is not a name"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_changes_of_an_arm_name_the_argument(name: str) -> None:
    change, problem = CHANGES[name]
    with pytest.raises(al.InputError, match=problem):
        change(al.planar_arm([0.5, 0.4]))
