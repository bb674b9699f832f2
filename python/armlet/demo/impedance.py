"""Exercise 3 of the exam (docs/exam.md): the equations of the rigid arm in Cartesian coordinates, checked along a run.

    M_x x'' + S_x x' + g_x = J^-T tau + F                    (7),   g_x = J^-T g
    M_x x'' + (S_x + D_m) x' + K_m (x - x_d) = F             the target model
    M_x = J^-T M J^-1,   S_x = J^-T C(q, v) J^-1 - M_x J-dot J^-1

' is the time derivative, and ^-T the transposed inverse. F is the force at the tip x with the Jacobian J and the target x_d. (7) is the
number of the equation in the exam. M, C and g are mass matrix, Coriolis matrix and gravity torque. K_m and D_m are Cartesian stiffness and
damping.

The equation `B theta_ddot + tau_J = tau` of the elastic arm is also checked.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

import armlet as al

if TYPE_CHECKING:
    from .report import Report

Array: TypeAlias = NDArray[np.float64]


def rows(matrix: Array, vector: Array) -> Array:
    """Multiply a matrix by a vector at every record: (K, i, j) times (K, j) gives (K, i)."""
    return np.asarray(np.einsum("kij,kj->ki", matrix, vector))


def cartesian(arm: al.Arm, run: al.Run, force: Array, rate: ArrayLike) -> dict[str, Array]:
    """M_x x'', S_x x', g_x, J^-T tau and x' along a run of an arm with two joints, (K, 2) each.

    The equation of motion is M_x x'' + S_x x' + g_x = J^-T tau + F, and F acts at the frame link2. `rate` is the velocity argument of the
    Coriolis matrix C in S_x.
    """
    assert run.tau is not None
    J, J_dot = arm.jacobian(run.q, "link2")[:, :2], arm.jacobian_dot(run.q, run.v, "link2")[:, :2]
    wrench = np.concatenate([force, np.zeros(4)])
    a = arm.forward_dynamics(run.q, run.v, run.tau, wrench=wrench, wrench_frame="link2")
    inverse = np.linalg.inv(J)
    transposed = np.swapaxes(inverse, 1, 2)
    M_x = transposed @ arm.mass_matrix(run.q) @ inverse
    S_x = transposed @ arm.coriolis_matrix(run.q, rate) @ inverse - M_x @ J_dot @ inverse
    x_dot = rows(J, run.v)
    return {
        "M_x x''": rows(M_x, rows(J, a) + rows(J_dot, run.v)),
        "S_x x'": rows(S_x, x_dot),
        "g_x": rows(transposed, arm.gravity(run.q)),
        "J^-T tau": rows(transposed, run.tau),
        "x'": x_dot,
    }


def run(report: Report, arm: al.Arm, target: Array, gains: tuple[Array, Array], q0: ArrayLike, force: Array) -> None:
    K_m, D_m = gains
    law = al.CartesianImpedance(arm, target, K_m, D_m, frame="link2", axes="xy")
    rigid = al.simulate(al.RigidArm(arm), law, q0, t_end=3.0, t_eval=np.linspace(0.0, 3.0, 601), force=force, method="dop853")
    largest, balance = rigid.monitors["target"].max(), rigid.monitors["target_balance"].max()
    report.bound("rigid run: residual of the target model divided by its largest term", balance / largest, 1e-9)
    terms = cartesian(arm, rigid, force, rigid.v)
    left = terms["M_x x''"] + terms["S_x x'"] + terms["g_x"] - terms["J^-T tau"] - force
    # J has a condition number below 10, and the terms are below 100 N. So rounding is below 1e-11 N.
    report.bound("equation (7) with g_x = J^-T g along that run (N)", np.abs(left).max(), 1e-11)
    printed = cartesian(arm, rigid, force, rigid.q)["S_x x'"]
    spring = K_m * (arm.position(rigid.q, "link2")[:, :2] - target)
    rest = np.abs(terms["M_x x''"] + printed + D_m * terms["x'"] + spring - force).max()
    text = "S(q, q)"
    report.equal(f"residual of the target model: {rest:.1f} N with S(q, q) in S_x, zero with S(q, v)", True, rest > 0.1, text, "E8")


def motors(report: Report, run: al.Run, K_J: Array, B: Array) -> None:
    """Erratum E7: check the motor equation along a run. theta_ddot is the numerical derivative of the recorded theta_dot."""
    assert run.theta is not None and run.theta_dot is not None and run.tau is not None
    h = run.t[1] - run.t[0]
    w, tau_J = run.theta_dot, K_J * (run.theta - run.q)
    # The five-point difference has the error h^4/30 times the fifth derivative. With 2.5 ms this is about 1e-2 N m for modes of 300 1/s.
    # These modes have decayed after 0.5 s.
    slope = (w[:-4] - 8 * w[1:-3] + 8 * w[3:-1] - w[4:]) / (12 * h)
    late = run.t[2:-2] > 0.5
    left = (B * slope + tau_J[2:-2] - run.tau[2:-2])[late]
    text = "B theta_hat + tau_J = tau"
    report.near("B theta_ddot + tau_J - tau from 0.5 s on, largest (N m)", 0.0, np.abs(left).max(), 1e-6, text, "E7")
    wrong = float(np.abs(B * run.theta + tau_J - run.tau).max())
    report.equal(f"residual with theta in place of theta_ddot: {wrong:.2f} N m", True, wrong > 0.01, text, "E7")
