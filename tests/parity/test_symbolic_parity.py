"""Symbolic formulas of arms: term by term against formulas derived by hand, and numerically against armlet and the reference."""

from __future__ import annotations

import pickle
import subprocess
import sys
from typing import Any

import models
import numpy as np
import pytest
import sympy
from numpy.typing import NDArray
from trees import both

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]
STATES = 1000


def symbols(text: str) -> Any:
    return sympy.symbols(text, real=True)


def close(got: Array, wanted: Array, scale: float = 0.0, tolerance: float = 1e-13) -> None:
    """Compare relative to the largest entry."""
    assert got.shape == wanted.shape
    assert np.abs(got - wanted).max(initial=0.0) <= tolerance * max(scale, np.abs(wanted).max(initial=0.0))


def check(arm: al.Arm, lengths: bool, seed: int = 0) -> Any:
    """Compare M, C, g and Y with the functions of the arm at random states, and return the formulas."""
    formulas = arm.symbolic(lengths=lengths)
    q, v, v_r, a_r = np.random.default_rng(seed).uniform(-2.0, 2.0, (4, STATES, arm.n))
    M, C = arm.mass_matrix(q), arm.coriolis_matrix(q, v)
    close(formulas.function("M")(q), M)
    # Terms of C and g that are as large as M may cancel.
    close(formulas.function("C")(q, v), C, float(np.abs(M).max()))
    close(formulas.function("g")(q), arm.gravity(q), float(np.abs(M).max()))
    close(formulas.function("Y")(q, v, v_r, a_r), arm.regressor(q, v, v_r, a_r))
    return formulas


def test_the_formulas_of_the_exam() -> None:
    formulas = check(al.planar_pr(2.0, 0.5, 0.7), False)
    A, B, C, q2, v2, v_r2, a_r1, a_r2 = symbols("A B C q2 v2 v_r2 a_r1 a_r2")
    assert formulas.M == sympy.Matrix([[A, B * sympy.cos(q2)], [B * sympy.cos(q2), C]])
    assert formulas.C == sympy.Matrix([[0, -B * sympy.sin(q2) * v2], [0, 0]])
    assert formulas.g == sympy.zeros(2, 1)
    Y = [[a_r1, a_r2 * sympy.cos(q2) - v2 * v_r2 * sympy.sin(q2), 0], [0, a_r1 * sympy.cos(q2), a_r2]]
    assert formulas.Y == sympy.Matrix(Y)
    assert formulas.values == {A: 2.0, B: 0.5, C: 0.7}


def test_the_exam_s_robot_as_a_tree_of_bodies() -> None:
    """For the exam's robot, `A` is `m1 + m2`, `B` the first moment of link 2 across the slide, and `C` the inertia of link 2."""
    slide = {"type": "P", "axis": [1.0, 0.0, 0.0], "phi": [1.5, *[0.0] * 9]}
    turn = {"type": "R", "axis": [0.0, 0.0, 1.0], "phi": [0.5, 0.0, -1.0, 0, 0, 0, 0, 0, 0, 0.7]}
    formulas = check(al.Arm.from_chain([slide, turn], gravity=[0.0, 0.0, 0.0]), False)
    m1, m2, mcy2, Izz2, q2, v2 = symbols("m1 m2 mcy2 Izz2 q2 v2")
    assert formulas.M == sympy.Matrix([[m1 + m2, -mcy2 * sympy.cos(q2)], [-mcy2 * sympy.cos(q2), Izz2]])
    assert formulas.C == sympy.Matrix([[0, mcy2 * v2 * sympy.sin(q2)], [0, 0]])


def test_the_pendulum() -> None:
    """The formulas of a pendulum are `I theta_ddot + G sin theta`, with `G = m g0 d`."""
    formulas = check(al.pendulum(2.0, 3.0), True)
    Izz1, mcx1, gy, q1 = symbols("Izz1 mcx1 gy q1")
    assert formulas.M == sympy.Matrix([[Izz1]]) and formulas.C == sympy.Matrix([[0]])
    assert formulas.g == sympy.Matrix([[-gy * mcx1 * sympy.sin(q1)]])
    assert formulas.values == {Izz1: 2.0, mcx1: pytest.approx(3.0 / 9.81), gy: -9.81}


def test_two_links_read_as_in_a_textbook() -> None:
    arm = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], gravity=(0.0, 0.0))
    m2, mcx2, Izz1, Izz2, x2, q2, v1, v2 = symbols("m2 mcx2 Izz1 Izz2 x2 q2 v1 v2")
    formulas, c, s = check(arm, True), sympy.cos(q2), sympy.sin(q2)
    M12 = Izz2 + mcx2 * x2 * c
    assert formulas.M == sympy.Matrix([[Izz1 + Izz2 + m2 * x2**2 + 2 * mcx2 * x2 * c, M12], [M12, Izz2]])
    assert formulas.C == sympy.Matrix([[-mcx2 * x2 * s * v2, -mcx2 * x2 * s * (v1 + v2)], [mcx2 * x2 * s * v1, 0]])
    assert str(arm.symbolic().M[0, 0]) == "Izz1 + Izz2 + m2/4 + mcx2*cos(q2)"  # 0.5 m is a fraction, 0.3 m is a decimal number
    assert "0.3*mcx2" in str(al.planar_arm([0.3, 0.4]).symbolic().M[0, 1])


@pytest.mark.parametrize("lengths", [False, True])
@pytest.mark.parametrize("n", [1, 2])
def test_random_trees(n: int, lengths: bool) -> None:
    """Formulas of random trees agree with armlet and the reference: prismatic joints, branches, fixed bodies, rotated axes, armature."""
    arm, reference, place, _ = both(n, 3)
    formulas = check(arm, lengths)
    q = np.random.default_rng(n).uniform(-2.0, 2.0, (STATES, n))
    there, (rows, columns) = np.argsort(place), np.ix_(place, place)
    # The reference multiplies 4 x 4 matrices, so it rounds differently.
    close(formulas.function("M")(q), reference.mass_matrix(q[:, there])[:, rows, columns], tolerance=1e-12)
    close(formulas.function("g")(q), reference.gravity(q[:, there])[:, place], tolerance=1e-12)


def test_three_joints_of_an_arm_in_space() -> None:
    """A shoulder and two parallel axes: the formulas have squares of cosines of absolute angles."""
    phi, quarter = [1.0, 0.2, 0.0, 0.1, 0.02, 0.0, 0.03, 0.0, 0.0, 0.04], np.pi / 2
    joints = [
        {"type": "R", "axis": [0, 0, 1], "xyz": [0, 0, 0.3], "phi": phi},
        {"type": "R", "axis": [0, 0, 1], "rpy": [quarter, 0, 0], "phi": phi},
        {"type": "R", "axis": [0, 0, 1], "xyz": [0.4, 0, 0], "phi": phi, "armature": 0.2},
    ]
    formulas = check(al.Arm.from_chain(joints), False)
    assert "0.16*m3*cos(q2)**2" in str(formulas.M[0, 0]) and "Ir3" in str(formulas.M[2, 2]) and "Ir3" not in str(formulas.M[1, 1])


def test_four_joints() -> None:
    """Two parallel revolute axes, a prismatic joint and a wrist have short formulas."""
    phi = [1.0, 0.2, 0.0, 0.0, 0.02, 0.0, 0.03, 0.0, 0.0, 0.04]
    places = [("R", 0.0), ("R", 0.4), ("P", 0.3), ("R", 0.0)]
    joints = [{"type": kind, "axis": [0, 0, 1], "xyz": [x, 0, 0], "phi": phi} for kind, x in places]
    formulas = check(al.Arm.from_chain(joints), True)
    assert str(formulas.M[2, 2]) == "m3 + m4" and str(formulas.M[0, 3]) == "Izz4 + mcx4*(x2*cos(q2 + q4) + x3*cos(q4))"


def test_numbers_of_other_arms_go_into_the_same_formulas() -> None:
    one, other = models.TWO_LINKS, al.planar_arm([0.7, 0.4], masses=[2.0, 3.0])
    q = np.random.default_rng(0).uniform(-2.0, 2.0, (3, 4, 2))
    formulas = one.symbolic(lengths=True)
    close(formulas.function("M", other.symbolic(lengths=True).values)(q), other.mass_matrix(q))
    close(formulas.function("g")(q[0, 0].tolist()), one.gravity(q[0, 0]), 1.0)


def test_latex_and_repr() -> None:
    formulas = models.TWO_LINKS.symbolic(lengths=True)
    text = formulas.latex()
    assert text.startswith("\\begin{aligned}\nM &= \\left[") and all(f"\n{name} &= " in text for name in "CgY")
    assert formulas.latex("M") == (
        r"M = \left[\begin{matrix}I_{zz,1} + I_{zz,2} + m_{2} x_{2}^{2} + 2 m_{2} c_{x,2} x_{2} \cos{\left(q_{2} \right)} & "
        r"I_{zz,2} + m_{2} c_{x,2} x_{2} \cos{\left(q_{2} \right)}\\I_{zz,2} + m_{2} c_{x,2} x_{2} \cos{\left(q_{2} \right)} & "
        r"I_{zz,2}\end{matrix}\right]"
    )
    assert r"a_{r1}" in formulas.latex("Y") and r"g_{y}" in formulas.latex("g")
    assert repr(formulas).startswith("<Formulas of 2 joints, Y has shape (2, 20)>\nM = Matrix([[Izz1 + Izz2")
    again = pickle.loads(pickle.dumps(formulas))
    assert (again.M, again.C, again.g, again.Y, again.values) == (formulas.M, formulas.C, formulas.g, formulas.Y, formulas.values)


def test_bad_input() -> None:
    formulas = al.planar_pr(2.0, 0.5, 0.7).symbolic()
    with pytest.raises(al.InputError, match=r"symbolic: arm has too many joints.*expected at most 4, got 5"):
        al.planar_arm([0.1] * 5).symbolic()
    with pytest.raises(al.InputError, match="latex: name is unknown: expected one of M, C, g, Y, got 'S'"):
        formulas.latex("S")
    with pytest.raises(al.InputError, match="function: name is unknown"):
        formulas.function("S")
    with pytest.raises(al.InputError, match="function: values name what this arm has not: expected symbols among A, B, C, got D"):
        formulas.function("M", {sympy.Symbol("D"): 1.0})
    with pytest.raises(al.InputError, match="C: has the wrong number of arguments: expected q, v, got 1"):
        formulas.function("C")([0.0, 0.0])
    with pytest.raises(al.InputError, match=r"C: v has the wrong shape: expected \(\.\.\., 2\), got \(3,\)"):
        formulas.function("C")([0.0, 0.0], [0.0, 0.0, 0.0])


def test_without_sympy_the_error_names_the_package() -> None:
    code = """
import sys
sys.modules["sympy"] = None
import armlet as al
try:
    al.planar_pr(2.0, 0.5, 0.7).symbolic()
except ImportError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "symbolic: sympy is not installed: pip install '.[sympy]' in the folder of armlet's sources\n"


def test_the_reference_s_pr_robot() -> None:
    q, v = np.random.default_rng(5).uniform(-2.0, 2.0, (2, STATES, 2))
    formulas, reference = al.planar_pr(2.0, 0.5, 0.7).symbolic(), ref.planar_pr(2.0, 0.5, 0.7)
    close(formulas.function("C")(q, v), reference.coriolis_matrix(q, v))
