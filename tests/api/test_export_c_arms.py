"""Functions of arms as C: their results equal armlet's to the last bit, for every function and arms of every kind."""

from __future__ import annotations

import itertools
import re
import subprocess
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import models
import numpy as np
import pytest
from compiled_c import COMPILERS, Functions, build

import armlet as al

pytestmark = pytest.mark.compile

PAIRS = ["mass_matrix", "coriolis_matrix", "gravity", "bias", "inverse_dynamics", "forward_dynamics", "regressor"]
INPUTS = {
    "mass_matrix": 1,
    "coriolis_matrix": 2,
    "christoffel": 1,
    "gravity": 1,
    "bias": 2,
    "inverse_dynamics": 3,
    "forward_dynamics": 3,
    "regressor": 4,
    "energy": 2,
    "pose": 1,
    "pose_vector": 1,
    "position": 1,
    "jacobian": 1,
    "jacobian_dot": 2,
    "center_of_mass": 1,
    "center_of_mass_jacobian": 1,
    "inverse_dynamics_derivatives": 3,
    "forward_dynamics_derivatives": 3,
}
FRAMED = ("pose", "pose_vector", "position", "jacobian", "jacobian_dot")


def branched() -> al.Arm:
    """A tree with a trunk of two joints and two branches, one of which has a prismatic joint."""
    inertia = "<inertia ixx='0.02' iyy='0.03' izz='0.01' ixy='0.001' ixz='0' iyz='0'/>"
    link = f"<link name='{{0}}'><inertial><origin xyz='0.1 0.02 0.2'/><mass value='1.5'/>{inertia}</inertial></link>"
    placed = "<origin xyz='0.1 0 0.3' rpy='0.2 0.1 -0.3'/><axis xyz='{4}'/><limit effort='9' velocity='9' lower='-2' upper='2'/>"
    joint = f"<joint name='{{0}}' type='{{1}}'><parent link='{{2}}'/><child link='{{3}}'/>{placed}</joint>"
    tree = [("j1", "revolute", "base", "a", "0 0 1"), ("j2", "revolute", "a", "b", "0 1 0"), ("j3", "prismatic", "b", "c", "1 0 0")]
    tree += [("j4", "revolute", "b", "d", "1 1 0"), ("j5", "continuous", "d", "e", "0 1 1")]
    links = "".join(link.format(name) for name in ("a", "b", "c", "d", "e"))
    return al.load_urdf(f"<robot name='tree'><link name='base'/>{links}{''.join(joint.format(*j) for j in tree)}</robot>")


ARMS = {
    "planar_pr": lambda: models.PR,
    "pendulum": lambda: al.pendulum(0.3, 2.0),
    "planar 3R": lambda: models.THREE_LINKS,
    "six axes": lambda: models.SIX_AXES,
    "seven axes": lambda: models.SEVEN_AXES,
    "tree": branched,
}

#: Names of links that would end a comment in C, begin one, or continue it in the next line. The last two are not ASCII: one is harmless,
#: and the other has control characters for the direction and the end of lines.
NAMES = [
    "t */ int injected(void){return 42;} /* ",
    "a*/b",
    "a/*b",
    "*",
    "/*/",
    "a\\",
    "a??/",
    "a??/\nb",
    "a\nint injected;",
    "\u202ea\u2028",
    "Gr\u00fc\u00dfe",
]


def expected(arm: al.Arm, name: str, inputs: list[Any], **options: Any) -> np.ndarray:
    frame = [arm.tip_frame] if name in FRAMED else []
    answer = getattr(arm, name)(*inputs, *frame, **options)
    if name == "energy":
        return np.stack(answer, axis=-1)
    if name.endswith("derivatives"):
        return np.concatenate(answer, axis=-2)
    return np.asarray(answer)


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", ARMS)
def test_functions_have_the_bits_of_armlet(name: str, compiler: str, tmp_path: Path) -> None:
    arm = ARMS[name]()
    names = [*PAIRS, "energy"] if name == "planar_pr" else list(INPUTS)
    c = Functions(al.export_c(arm, tmp_path, functions=names), compiler)
    rng = np.random.default_rng(7)
    x = rng.uniform(-3.0, 3.0, (4, 1000, arm.n))
    x[:, 0] = 0.0
    for function in names:
        inputs = x[: INPUTS[function]]
        answers = expected(arm, function, list(inputs))
        for k in range(1000):
            np.testing.assert_array_equal(c(function, *inputs[:, k]), answers[k].ravel(), err_msg=f"{function}, state {k}")


@pytest.mark.parametrize("compiler", COMPILERS)
def test_functions_include_friction_armature_and_wrenches(compiler: str, tmp_path: Path) -> None:
    arm = models.SIX_AXES.with_drives(armature=[0.1] * 6, damping=[0.5] * 6, friction=[0.2] * 6)
    frame = arm.frame_names[3]
    functions = ["bias", "regressor", ("inverse_dynamics", frame), ("forward_dynamics", frame), ("jacobian", frame)]
    c = Functions(al.export_c(arm, tmp_path, functions=functions, friction=True, armature=True), compiler)
    rng = np.random.default_rng(8)
    behind = frame.replace("-", "_")
    for _ in range(200):
        q, v, a, b = rng.uniform(-3.0, 3.0, (4, 6))
        wrench = rng.uniform(-9.0, 9.0, 6)
        np.testing.assert_array_equal(c("bias", q, v), arm.bias(q, v, friction=True))
        np.testing.assert_array_equal(c("regressor", q, v, a, b), arm.regressor(q, v, a, b, friction=True, armature=True).ravel())
        for name in ("inverse_dynamics", "forward_dynamics"):
            answer = getattr(arm, name)(q, v, a, wrench=wrench, wrench_frame=frame, friction=True)
            np.testing.assert_array_equal(c(f"{name}_{behind}", q, v, a, wrench), answer)
        np.testing.assert_array_equal(c(f"jacobian_{behind}", q), arm.jacobian(q, frame).ravel())


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", ["planar 3R", "six axes", "tree"])
def test_derivatives_with_friction_have_the_bits_of_armlet(name: str, compiler: str, tmp_path: Path) -> None:
    bare = ARMS[name]()
    arm = bare.with_drives(damping=[0.7] * bare.n, friction=[0.1] * bare.n)
    names = ["inverse_dynamics_derivatives", "forward_dynamics_derivatives"]
    c = Functions(al.export_c(arm, tmp_path, functions=names, friction=True), compiler)
    rng = np.random.default_rng(11)
    for inputs in rng.uniform(-3.0, 3.0, (100, 3, arm.n)):
        for function in names:
            answer = expected(arm, function, list(inputs), friction=True).ravel()
            assert not np.array_equal(answer, expected(arm, function, list(inputs)).ravel())
            np.testing.assert_array_equal(c(function, *inputs), answer, err_msg=function)


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_a_name_from_a_file_is_no_code(name: str, compiler: str, tmp_path: Path) -> None:
    body = "<inertial><mass value='1.5'/><inertia ixx='0.02' iyy='0.03' izz='0.01' ixy='0' ixz='0' iyz='0'/></inertial>"
    joint = f"<joint name={quoteattr('j' + name)} type='continuous'><parent link='base'/><child link={quoteattr(name)}/></joint>"
    arm = al.load_urdf(f"<robot name={quoteattr(name)}><link name='base'/><link name={quoteattr(name)}>{body}</link>{joint}</robot>")
    name = name.strip()
    assert arm.tip_frame == name
    framed = [*FRAMED, ("inverse_dynamics", name), ("forward_dynamics", name)]
    law = al.PDGravity(arm, [0.4], kp=80.0, kd=16.0)
    for prefix, files in (("arm", al.export_c(arm, tmp_path, functions=framed)), ("law", al.export_c(law, tmp_path / "law"))):
        library = build(files, compiler, "-pedantic", "-Wtrigraphs")
        symbols = subprocess.run(["nm", "-D", "--defined-only", str(library)], capture_output=True, text=True, check=True).stdout
        exported = {line.split()[-1] for line in symbols.splitlines()} - {"_init", "_fini"}
        declared = set(re.findall(rf"^(?:int|void) ({prefix}_\w+)\(", files[0].read_text(), re.MULTILINE))
        assert exported == declared
        assert len(exported) == (len(framed) if prefix == "arm" else 2)


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_long_function_in_several_parts_has_the_same_bits(compiler: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(9)
    joint = {"type": "R", "rpy": [0.3, -0.2, 0.5], "xyz": [0.2, 0.1, 0.3], "phi": [1.0, 0.1, 0.2, 0.1, 0.3, 0.01, 0.3, 0.02, 0.01, 0.2]}
    arm = al.Arm.from_chain([joint | {"axis": list(rng.normal(size=3))} for _ in range(14)])
    files = al.export_c(arm, tmp_path, functions=["forward_dynamics", "christoffel"])
    assert "arm_christoffel_5(" in files[1].read_text()
    c = Functions(files, compiler)
    for _ in range(20):
        q, v, tau = rng.uniform(-2.0, 2.0, (3, 14))
        np.testing.assert_array_equal(c("forward_dynamics", q, v, tau), arm.forward_dynamics(q, v, tau))
        np.testing.assert_array_equal(c("christoffel", q), arm.christoffel(q).ravel())


def test_rounding_of_every_product_is_another_answer_and_close(tmp_path: Path) -> None:
    arm = models.SIX_AXES
    rounded = Functions(al.export_c(arm, tmp_path, functions=["bias"], fused=False), COMPILERS[0])
    assert "fma(" not in (tmp_path / "arm.c").read_text()
    rng = np.random.default_rng(10)
    x = rng.uniform(-3.0, 3.0, (100, 2, 6))
    answers = np.array([rounded("bias", *pair) for pair in x])
    # The C and armlet compute the same sums of products. They round differently, because this C has no fused operations.
    np.testing.assert_allclose(answers, arm.bias(x[:, 0], x[:, 1]), rtol=0.0, atol=1e-11)


def test_invalid_inputs_give_a_status(tmp_path: Path) -> None:
    arm = models.TWO_LINKS
    c = Functions(al.export_c(arm, tmp_path, functions=["gravity", "forward_dynamics"]), COMPILERS[0])
    for bad, status in ((np.nan, 1), (np.inf, 1), (-np.inf, 1), (1e6, 2), (-3e7, 2)):
        for at in range(2):
            q = np.zeros(2)
            q[at] = bad
            got, out = c.status("gravity", q)
            assert got == status
            assert np.isnan(out).all()
    got, out = c.status("forward_dynamics", [0.1, 0.2], [1e200, 0.0], [0.0, 0.0])
    assert got == 4
    assert np.isnan(out).all()
    np.testing.assert_array_equal(c("gravity", [999_999.0, 0.5]), arm.gravity([999_999.0, 0.5]))


def test_each_function_compiles_without_the_others(tmp_path: Path) -> None:
    arm = models.TWO_LINKS
    for name in INPUTS:
        Functions(al.export_c(arm, tmp_path / name, functions=[name], prefix="one"), COMPILERS[0], prefix="one")


BAD: list[tuple[dict[str, Any], str]] = [
    ({"functions": ["mass"]}, "functions has one that is unknown: expected some of mass_matrix"),
    ({"functions": []}, "functions is not a list of names"),
    ({"functions": "gravity"}, "functions is not a list of names"),
    ({"functions": [3]}, "functions has an entry that is no name"),
    ({"functions": [("gravity", "link1")]}, "functions has a frame for gravity"),
    ({"functions": [("pose", "link9")]}, "frame is unknown"),
    ({"functions": ["bias", "bias"]}, r"functions has bias twice.*first bad index 1"),
    ({"prefix": "7up"}, "prefix is no name in C"),
    ({"prefix": "while"}, "prefix is no name in C"),
    ({"prefix": 3}, "prefix is not a name"),
    ({"friction": 2}, "friction is not a flag"),
    ({"fused": "yes"}, "fused is not a flag"),
    ({"dt": 1e-3}, "dt is not used"),
    ({"method": "nonsense"}, "method is not used: expected none for an arm, got 'nonsense'"),
    ({"method": "euler"}, "method is not used"),
    *[
        ({"prefix": name}, "prefix is no name for a target of CMake")
        for name in ("test", "all", "clean", "install", "help", "package", "ALL_BUILD", "m")
    ],
]


@pytest.mark.parametrize(("arguments", "message"), BAD, ids=[f"{next(iter(bad))} {k}" for k, (bad, _) in enumerate(BAD)])
def test_bad_arguments_are_refused(arguments: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(al.InputError, match=rf"^export_c: {message}"):
        al.export_c(models.TWO_LINKS, tmp_path / "out", **arguments)
    assert not (tmp_path / "out").exists()


def test_an_arm_without_frames_exports_only_its_dynamics(tmp_path: Path) -> None:
    arm = models.PR
    for function in ("pose", "christoffel", "center_of_mass"):
        with pytest.raises(al.InputError, match="functions has one that planar_pr does not have"):
            al.export_c(arm, tmp_path, functions=[function])


def test_files_of_others_are_kept(tmp_path: Path) -> None:
    arm = models.TWO_LINKS
    first = [file.read_text() for file in al.export_c(arm, tmp_path)]
    # armlet may overwrite files that armlet wrote.
    files = al.export_c(arm, tmp_path)
    assert [file.read_text() for file in files] == first
    assert [file.name for file in files] == ["arm.h", "arm.c", "CMakeLists.txt"]
    for file in files:
        file.write_text("mine")
        with pytest.raises(al.InputError, match="folder holds a file that armlet did not make"):
            al.export_c(arm, tmp_path)
        al.export_c(arm, tmp_path, overwrite=True)
        assert [file.read_text() for file in files] == first


def test_the_header_describes_the_arm(tmp_path: Path) -> None:
    arm = models.SIX_AXES
    header, source, cmake = (file.read_text() for file in al.export_c(arm, tmp_path, prefix="robot"))
    assert header.startswith(f"/* Made by armlet {al.__version__}")
    said = ("rad, rad/s, rad/s^2, N m", "m, mcx, mcy, mcz, Ixx", "-ffp-contract=off", "#define ROBOT_N 6", "ROBOT_OK = 0")
    for text in (*arm.joint_names, *said):
        assert text in header
    assert "-ffp-contract=off" in cmake
    included = [line for line in source.splitlines() if line.startswith("#include")]
    assert included == ['#include "robot.h"', "#include <math.h>", "#include <string.h>"]
    for word in ("malloc", "calloc", "static double", "goto"):
        assert word not in source
    assert all(len(list(group)) == 1 for _, group in itertools.groupby(sorted(al.export_c(arm, tmp_path, prefix="robot"))))
