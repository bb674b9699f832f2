"""Arms from unusual models: each is accepted, with a line in `arm.report`, or refused with a typed error that names the place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import models
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
    "mass too large": (robot(joint(), LINK.replace('value="1"', 'value="1.1e9"')), 3, "mass of link l1 is implausible"),
    "centre too far": (robot(joint(), LINK.replace("0.1 0 0", "1e20 0 0")), 3, "xyz of origin is implausible: expected at most 1e6 m"),
    "joint too far": (robot(joint('\n<origin xyz="0 0 1e20"/>')), 5, "xyz of origin is implausible"),
    "axis too short": (robot(joint(axis="0 0 1e-200")), 4, "axis of joint j1 is implausible"),
    "axis too long": (robot(joint(axis="0 0 1e308")), 4, "axis of joint j1 is implausible"),
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
    "mimic": (robot(joint('<mimic joint="jx" multiplier="2"/>')), 4, "joint j1 mimics jx, which is no joint"),
    "cut short": (robot(joint())[:60], 1, "well-formed"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_invalid_models_are_refused_with_their_line(name: str, tmp_path: Path) -> None:
    text, line, problem = REFUSED[name]
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    for given in (text, str(path), path):
        with pytest.raises(al.ModelError) as caught:
            al.load_urdf(given)
        assert problem in str(caught.value) and caught.value.line == line
        assert caught.value.file == ("<string>" if given is text else str(path))


REPORTED = {
    "limits crossed": (robot(joint('<limit lower="2" upper="-2"/>')), "line 4: joint j1 has its lower limit 2 above its upper limit -2"),
    "negative velocity": (robot(joint('<limit velocity="-3"/>')), "line 4: joint j1 has a negative velocity limit: -3"),
    "negative effort": (robot(joint('<limit effort="-1"/>')), "line 4: joint j1 has a negative effort limit: -1"),
    "negative damping": (robot(joint('<dynamics damping="-1"/>')), "line 4: joint j1 has negative damping: -1"),
    "no inertial": (robot(joint(), '<link name="l1"/>'), "zero mass: the bodies moved by j1"),
    "meshes": (robot(joint(), '<link name="l1"><visual/></link>'), "dropped: visual of link (1, first in line 3)"),
    "singular": (
        robot(joint(), '<link name="l1"/>'),
        "mass matrix not positive definite at 8 of 8 sampled configurations: joints j1",
    ),
    "no rigid body": (robot(joint(), LINK.replace('ixx="0.1"', 'ixx="9"')), "line 3: inertia of link l1 is no rigid body's"),
}


@pytest.mark.parametrize("name", REPORTED)
def test_unusual_models_are_accepted_and_reported(name: str) -> None:
    text, said = REPORTED[name]
    arm = al.load_urdf(text)
    assert arm.n == 1 and any(line.startswith(said) for line in arm.report), arm.report
    again = al.load_urdf(arm.to_urdf()[0])
    assert again.joint_names == arm.joint_names and np.array_equal(again.parameters, arm.parameters)


def test_spellings_of_one_robot_are_one_arm(tmp_path: Path) -> None:
    plain = al.load_urdf(robot(joint()))
    path = tmp_path / "robot with a space and <brackets>.urdf"
    path.write_bytes(b"\xef\xbb\xbf" + robot(joint()).replace("\n", "\r\n").encode())
    given: list[Any] = [
        "\ufeff" + robot(joint()),
        "\n  " + robot(joint()),
        path,
        robot("<!-- <joint> -->" + joint()),
        robot(joint(axis="0 0 7")),
        robot(joint(axis="+0 -0 1e-6")),
        robot(joint(axis="0 0 1e6")),
        "\n<?xml version='1.0'?>\n" + robot(joint()),
        "<!-- mine -->\n<?xml version='1.0' encoding='utf-8'?>\n" + robot(joint()),
    ]
    for other in given:
        arm = al.load_urdf(other)
        assert arm.joint_names == plain.joint_names
        assert np.array_equal(arm.mass_matrix([0.3]), plain.mass_matrix([0.3])), other
    named = al.load_urdf(robot(joint(name="joint one").replace("l1", "link one"), LINK.replace("l1", "link one")))
    assert named.joint_names == ("joint one",) and "link one" in named.frame_names


@pytest.mark.parametrize("least, accepted", [(-0.9e-7, True), (-1.2e-7, False)])
def test_printed_digits_of_small_inertias_are_forgiven(least: float, accepted: bool) -> None:
    """Robot files have seven or eight decimals.

    So a principal moment down to -1e-7 kg m^2 is accepted as a rounding error. A smaller one is refused.
    """
    small = LINK.replace('value="1"', 'value="1e-6"').replace(INERTIA, f'<inertia ixx="{least}" iyy="1e-6" izz="1e-6"/>')
    if not accepted:
        with pytest.raises(al.ModelError, match="negative principal moment") as caught:
            al.load_urdf(robot(joint(), small))
        assert caught.value.line == 3
        return
    arm = al.load_urdf(robot(joint(), small))
    assert any("triangle inequality" in line for line in arm.report)
    assert not arm.check_parameters()


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
    # A link of length zero gives two coincident axes. A centre of mass may be behind its joint.
    arm = al.planar_arm([0.0, 0.5], masses=[1.0, 1.0], inertias=[0.1, 0.1], coms=[-0.1, 0.2])
    np.testing.assert_array_equal(arm.position([0.0, 0.0], "link2"), [0.5, 0.0, 0.0])


def test_the_argument_that_is_not_finite_is_named_by_its_index() -> None:
    arm = models.SIX_AXES
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
        models.PR.bias([0.0, 0.0], [[0.0, np.nan]])


def test_energies_are_written_into_out() -> None:
    arm = models.SIX_AXES
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
        change(models.TWO_LINKS)


@pytest.mark.parametrize("key", ["velocity", "effort", "armature", "damping", "friction"])
def test_limits_and_drives_of_a_chain_are_not_negative(key: str) -> None:
    with pytest.raises(al.InputError, match=rf'^Arm.from_chain: joints\[1\]\["{key}"\] is negative: expected a number >= 0, got -2'):
        al.Arm.from_chain([{"type": "R"}, {"type": "P", key: -2.0}])


def test_limits_of_a_chain_are_in_order() -> None:
    with pytest.raises(al.InputError, match=r'joints\[0\]\["lower"\] is above the upper limit: expected at most 0, got 1'):
        al.Arm.from_chain([{"type": "R", "lower": 1.0, "upper": 0.0}])


ROBOT = models.SIX_AXES
ZERO = np.zeros(6)

WRONG_KINDS = {
    "pose": (lambda x: ROBOT.pose(ZERO, x), "pose: frame is not a name: expected a string, got"),
    "pose_vector": (lambda x: ROBOT.pose_vector(ZERO, x), "pose_vector: frame is not a name"),
    "position": (lambda x: ROBOT.position(ZERO, x), "position: frame is not a name"),
    "jacobian": (lambda x: ROBOT.jacobian(ZERO, x), "jacobian: frame is not a name"),
    "jacobian_dot": (lambda x: ROBOT.jacobian_dot(ZERO, ZERO, x), "jacobian_dot: frame is not a name"),
    "wrench": (
        lambda x: ROBOT.inverse_dynamics(ZERO, ZERO, ZERO, wrench=ZERO, wrench_frame=[] if x is None else x),
        "inverse_dynamics: wrench_frame is not a name",
    ),
    "payload": (lambda x: ROBOT.with_payload(x, 1.0), "Arm.with_payload: frame is not a name"),
    "new frame": (lambda x: ROBOT.with_frame(x, "base"), "Arm.with_frame: name is not a name"),
    "parent": (lambda x: ROBOT.with_frame("tool", x), "Arm.with_frame: parent is not a name"),
    "locked": (lambda x: ROBOT.locked(x), "Arm.locked: joints is not a dict: expected names of joints"),
    "example": (lambda x: al.example_urdf(x), "example_urdf: name is not a name"),
    "root": (lambda x: al.load_urdf(al.example_urdf("planar_2r"), root=[] if x is None else x), "load_urdf: root is not a name"),
    "tip": (lambda x: al.load_urdf(al.example_urdf("planar_2r"), tip=[] if x is None else x), "load_urdf: tip is not a name"),
    "convention": (lambda x: al.Arm.from_dh([[1, 0, 0, 0]], convention=[] if x is None else x), "Arm.from_dh: convention is not a name"),
}


@pytest.mark.parametrize("value", [3, None, b"link1", ["link1"]], ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("name", WRONG_KINDS)
def test_names_of_the_wrong_kind(name: str, value: Any) -> None:
    call, problem = WRONG_KINDS[name]
    with pytest.raises(al.InputError) as caught:
        call(value)
    assert problem in str(caught.value)


FLAGGED = ["bias", "inverse_dynamics", "forward_dynamics", "inverse_dynamics_derivatives", "forward_dynamics_derivatives", "linearize"]


@pytest.mark.parametrize("function", [*FLAGGED, "regressor", "base_parameters", "identify"])
@pytest.mark.parametrize("value", [1, "yes", np.ones(2)], ids=lambda value: type(value).__name__)
def test_flags_of_the_wrong_kind(function: str, value: Any) -> None:
    count = {"bias": 2, "regressor": 4, "base_parameters": 0, "identify": 4}.get(function, 3)
    with pytest.raises(al.InputError, match=rf"{function}: friction is not a flag: expected True or False, got"):
        getattr(ROBOT, function)(*[np.zeros((9, 6))] * count, friction=value)


PR = models.PR
FLAGS = {
    "MotorPD: online": lambda flag: al.MotorPD(PR, [0.0, 0.0], 1.0, 1.0, 1.0, online=flag),
    "JointImpedance: relative_damping": lambda flag: al.JointImpedance(PR, [0.0, 0.0], 1.0, 1.0, 1.0, 1.0, 0.5, relative_damping=flag),
    "inverse_kinematics: limits": lambda flag: al.inverse_kinematics(
        ROBOT, [al.Task(ROBOT.frame_names[-1], "xyz", [0.3, 0.0, 0.3])], np.zeros(ROBOT.n), limits=flag
    ),
    "integrate: dense_output": lambda flag: al.integrate(lambda t, y: y, (0.0, 1.0), [1.0], dense_output=flag),
    "integrate: lists": lambda flag: al.integrate(lambda t, y: [y[0]], (0.0, 1.0), [1.0], lists=flag),
}


@pytest.mark.parametrize("name", FLAGS)
def test_flags_of_other_functions(name: str) -> None:
    make = FLAGS[name]
    for value in (1, "no", np.ones(2)):
        with pytest.raises(al.InputError, match=rf"{name} is not a flag: expected True or False, got"):
            make(value)
    make(np.bool_(True))


def test_numpy_flags_are_flags() -> None:
    v = np.ones(6)
    np.testing.assert_array_equal(ROBOT.bias(ZERO, v, friction=np.True_), ROBOT.bias(ZERO, v, friction=True))
    assert np.any(ROBOT.bias(ZERO, v, friction=True) != ROBOT.bias(ZERO, v))


@pytest.mark.parametrize("name", ["six_axis", "seven_axis", "two_arms", "macro_micro_4r"])
def test_a_written_arm_is_read_again_without_change(name: str) -> None:
    """An arm that is written as URDF and read again has equal bits, also with payloads, tools and locked joints.

    Only the report may differ.
    """
    arm = al.load_urdf(al.example_urdf(name))
    frame = arm.frame_names[-1]
    tool = arm.with_frame("gripper", frame, xyz=[0.1, 0.2, 0.3], rpy=[0.4, -0.5, 2.6])
    load = tool.with_payload("gripper", 1.3, [0.01, 0.02, 0.03], np.diag([0.1, 0.2, 0.17]))
    for each in (arm, tool, load, load.locked({arm.joint_names[1]: 0.7})):
        again = al.load_urdf(each.to_urdf()[0])
        assert again == each and hash(again) == hash(each) and again.to_urdf() == each.to_urdf()
        np.testing.assert_array_equal(again.parameters, each.parameters)
        np.testing.assert_array_equal(again.pose(np.ones(each.n), "base"), each.pose(np.ones(each.n), "base"))
    moon = arm.with_gravity([0.0, 0.0, -1.62])
    assert load != tool and arm != moon and PR.gravity_vector is None
    np.testing.assert_array_equal([arm.gravity_vector, moon.gravity_vector], [[0.0, 0.0, -9.81], [0.0, 0.0, -1.62]])


def test_unexpanded_xacro_is_refused_with_its_line() -> None:
    for text, line in (
        (robot(joint(), LINK.replace('value="1"', 'value="${m}"')), 3),
        (robot(joint(name="${prefix}j1")), 4),
        (robot(joint(), LINK.replace('"l1"', '"$(arg side)l1"')), 3),
    ):
        with pytest.raises(al.ModelError, match="this is a xacro file: load_urdf expands") as caught:
            al.load_urdf(text)
        assert caught.value.line == line


def test_a_text_with_words_before_it_is_a_text() -> None:
    with pytest.raises(al.ModelError, match="well-formed"):
        al.load_urdf("robot: " + robot(joint()))
    with pytest.raises(al.InputError, match=r"load_urdf: path_or_xml cannot be read: expected a URDF file or its text, got nowhere.urdf"):
        al.load_urdf("nowhere.urdf")


@pytest.mark.parametrize("count, accepted", [(64, True), (65, False)])
def test_tags_of_many_attributes(count: int, accepted: bool) -> None:
    """The number of attributes of a tag is limited.

    The XML parser compares all pairs of them, so 16 MiB of attributes would take over 1 s.
    """
    text = robot("<x " + " ".join(f'a{i}="1"' for i in range(count)) + "/>" + joint())
    if accepted:
        assert al.load_urdf(text).n == 1
        return
    with pytest.raises(al.ModelError, match="has too many attributes: expected at most 64 in one tag"):
        al.load_urdf(text)


def test_infinite_limits_and_zero_payloads() -> None:
    joint = {"type": "R", "lower": -np.inf, "upper": np.inf, "velocity": float("inf"), "effort": 3.0}
    limits = al.Arm.from_chain([joint]).limits
    assert (limits["q_min"], limits["q_max"], limits["v_max"], limits["effort"]) == (-np.inf, np.inf, np.inf, 3.0)
    for key, value in (("lower", np.inf), ("upper", -np.inf), ("velocity", np.nan), ("effort", -np.inf)):
        with pytest.raises(al.InputError, match=rf'joints\[0\]\["{key}"\] is not finite'):
            al.Arm.from_chain([joint | {key: value}])
    with pytest.raises(al.InputError, match=r"Arm.with_payload: inertia has a negative principal moment: expected >= 0, got -1e0"):
        ROBOT.with_payload("base", 1.0, inertia=-np.eye(3))


def test_docstrings_of_arm_functions_have_shape_errors_and_example() -> None:
    properties = {name for name in dir(al.Arm) if isinstance(getattr(al.Arm, name), type(al.Arm.n))}
    for name in sorted(set(dir(al.Arm)) - properties):
        if not name.startswith("_"):
            text = getattr(al.Arm, name).__doc__ or ""
            assert ">>> " in text, name


def test_flags_of_laws_and_plants_of_the_wrong_kind() -> None:
    for value in (1, "yes"):
        with pytest.raises(al.InputError, match=r"Adaptive: natural is not a flag: expected True or False, got"):
            al.Adaptive(ROBOT, al.Hold(ZERO), 1.0, 1.0, 1.0, natural=value)  # type: ignore[arg-type]
        with pytest.raises(al.InputError, match=r"RigidArm: friction is (not a flag|unknown): expected"):
            al.RigidArm(ROBOT, friction=value)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["a\0b", "\x1b[31mred", "\ufffe"])
def test_names_that_no_file_can_hold_are_refused(name: str) -> None:
    arm = models.TWO_LINKS
    joint = {"type": "R", "axis": [0, 0, 1], "name": name}
    for make in (lambda: arm.with_frame(name, "link2"), lambda: al.Arm.from_chain([joint])):
        with pytest.raises(al.InputError, match=r"name.* holds (a control character|the character NUL)"):
            make()
    # The error reports the frame as unknown, or its name as one that contains NUL.
    for ask in (lambda: arm.position([0.0, 0.0], name), lambda: al.RigidArm(arm, wall=al.Wall(name, [0, 0, 0], [1, 0, 0], stiffness=1.0))):
        with pytest.raises(al.InputError, match=r"NUL|unknown"):
            ask()
