"""System 1: the PR robot on a horizontal plane under adaptive tracking control.

    tau = Y pi_hat + Kp e + Kd e_dot,   pi_hat_dot = Gamma Y's,   Y (A, B, C)' = M a_r + S v_r

Here ' is the transpose, Y the regressor, S the Coriolis matrix, s the sliding variable, pi = (A, B, C) the parameters and pi_hat their
estimate. e is the tracking error, v_r and a_r are reference velocity and acceleration, and Kp, Kd and Gamma the gains.

The checks compare the simulation with these results of the theory. dM/dt - 2S is skew-symmetric. The Lyapunov function
V1 = s'Ms/2 + (pi - pi_hat)'Gamma^-1(pi - pi_hat)/2 never increases. V1(0) - V1(t) is the integral of s'Kd s. The error e goes to zero from
every initial state and every initial estimate, even if the initial estimate is zero.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import armlet as al

from . import pictures

if TYPE_CHECKING:
    from .report import Report

TITLE = "System 1: adaptive tracking of the planar PR robot, all parameters unknown"

A, B, C = 2.0, 0.5, 0.5
KP, KD, GAMMA = (40.0, 20.0), (20.0, 10.0), 5.0
Q0 = (0.2, -0.3)

# The state (q1, q2, v1, v2, pi_hat) by time t, from rest in Q0 with pi_hat = 0. They were integrated with 25 digits and rounded to 13.
ORACLE = {
    0.25: (0.2600272316271, 0.2955772120178, 0.6692427878501, 2.635724070174, 0.563398733585, -0.1024356686385, -0.2466599487647),
    1.0: (0.5205529425694, 1.268307483847, -0.1470997213416, 0.07134418422685, 0.9123593755904, 1.040728065069, 0.4407824091997),
    5.0: (-0.6146579026193, 0.707485851029, 0.5123631780457, -0.9396413524381, 1.423745139093, 0.2173757784592, 0.4083759514278),
    20.0: (0.590644111435, 0.8491091488757, -0.1402353849307, -0.9912566194605, 1.919288452455, 0.5241748981693, 0.4961942530238),
    40.0: (0.1801873602466, -0.4580489119927, -0.459412298179, 0.7769800045361, 1.996733607075, 0.4995923455573, 0.4999415450309),
}
# The integrator has rtol = atol = 1e-12. Over 40 s its error grows to about 1e-10.
ORACLE_TOLERANCE = 2e-9


def motion() -> al.Sinusoid:
    """A motion with two frequencies per joint. It excites the system enough for the estimate to converge to the true parameters."""
    return al.Sinusoid(
        offset=[0.0, 0.3], amplitude=[[0.5, 0.2], [0.8, 0.3]], frequency=[[1.0, 2.3], [1.7, 0.6]], phase=[[0.0, 0.4], [0.0, 1.0]]
    )


def run(report: Report) -> None:
    arm = al.planar_pr(A, B, C)
    plant = al.RigidArm(arm)
    law = al.Adaptive(arm, motion(), kp=KP, kd=KD, gamma=GAMMA)
    identities(report, arm)
    report.draw_figure("pr_robot", lambda figure: pictures.pr_robot(figure.subplots()))
    against_oracle(report, plant, law)
    lyapunov(report, plant, law)
    from_anywhere(report, plant, law)


def identities(report: Report, arm: al.Arm) -> None:
    """Check that Y (A, B, C)' = M a_r + S v_r, with the Coriolis matrix S.

    Also check that the Christoffel matrices and Y are as printed in the exam, and that parameters with A C = B^2 raise an error.
    """
    q, v, v_r, a_r = np.random.default_rng(10062022).uniform(-3.0, 3.0, (4, 1000, 2))
    left = arm.regressor(q, v, v_r, a_r) @ arm.parameters
    right = (arm.mass_matrix(q) @ a_r[..., None] + arm.coriolis_matrix(q, v) @ v_r[..., None])[..., 0]
    # The terms are at most 15, so the tolerance is a few rounding errors of that size.
    report.bound("Y(q, v, v_r, a_r) pi = M a_r + S v_r, 1000 random states", np.abs(left - right).max(), 5e-14)
    try:
        al.planar_pr(1.0, 1.0, 1.0)
        answer = "accepted"
    except al.InputError:
        answer = "InputError"
    c = np.asarray(arm.christoffel(q))
    printed = np.zeros((1000, 2, 2, 2))
    printed[:, 0, 1, 1] = -B * np.sin(q[:, 1])
    report.near(
        "C_1 = [[0, 0], [0, -B sin q2]], C_2 = 0: Christoffel matrices minus the printed ones, largest",
        0.0,
        np.abs(c - printed).max(),
        1e-15,
    )
    products = np.einsum("ka,kiab,kb->ki", v, c, v) - arm.bias(q, v)
    report.bound("v' C_i v = (C v)_i", np.abs(products).max(), 1e-14)
    zero, Y = np.zeros(1000), np.asarray(arm.regressor(q, v, v_r, a_r))
    cos, sin = np.cos(q[:, 1]), np.sin(q[:, 1])
    rows = ((a_r[:, 0], a_r[:, 1] * cos - v[:, 1] * v_r[:, 1] * sin, zero), (zero, a_r[:, 0] * cos, a_r[:, 1]))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            report.bound(f"printed Y, entry ({i + 1}, {j + 1}), largest difference", np.abs(Y[:, i, j] - entry).max(), 5e-15)
    report.equal("a mass matrix that is not positive definite (A C = B^2)", "InputError", answer)


def against_oracle(report: Report, plant: al.RigidArm, law: al.Adaptive) -> None:
    """Check the state of the closed loop against an integration with 25 digits."""
    times = list(ORACLE)
    run = al.simulate(plant, law, Q0, t_end=times[-1], method="dop853", rtol=1e-12, atol=1e-12, t_eval=times)
    report.equal("times of the records", times, run.t.tolist())
    assert run.estimate is not None
    for state, t, expected in zip(np.hstack([run.q, run.v, run.estimate]), times, ORACLE.values(), strict=True):
        report.bound(f"(q, v, pi_hat) at {t:g} s minus the 25-digit solution", np.abs(state - expected).max(), ORACLE_TOLERANCE)


def lyapunov(report: Report, plant: al.RigidArm, law: al.Adaptive) -> None:
    """Check V1, its balance, the skew-symmetry of dM/dt - 2S and the last estimate in a run with 4001 records."""
    times = np.linspace(0.0, 40.0, 4001)
    run = al.simulate(plant, law, Q0, t_end=40.0, method="dop853", rtol=1e-12, atol=1e-12, t_eval=times)
    v1 = run.monitors["lyapunov"]
    report.near("V1(0)", 4.437722296768896, v1[0], 1e-12)
    # V1 starts at 4.4, so its differences have rounding errors of 1e-15. The tolerance also covers the error of the integrator.
    report.bound("largest increase of V1 between records", max(0.0, float(np.diff(v1).max())), 1e-12)
    report.bound("V1(0) - V1(t) - integral of s' Kd s, largest", np.abs(run.monitors["lyapunov_balance"]).max(), 1e-9)
    report.bound("skewness of M' - 2S, largest", np.abs(run.monitors["skewness"]).max(), 1e-13)
    assert run.estimate is not None
    # With this motion the estimation error decreases by a factor of five in 10 s.
    report.near("pi_hat(40 s) -> (A, B, C), this motion being rich enough", (A, B, C), run.estimate[-1], 5e-3)
    report.figure("adaptive", run)


def from_anywhere(report: Report, plant: al.RigidArm, law: al.Adaptive) -> None:
    """Check that e goes to zero from random initial states and a zero estimate, in a batch of 64 runs."""
    q0, v0 = np.random.default_rng(20220610).uniform(-2.0, 2.0, (2, 64, 2))
    batch = al.simulate_batch(plant, law, q0, v0=v0, t_end=60.0, dt=1e-3, method="rk4", keep="final", monitors=False)
    report.equal("64 random initial states: runs that reach 60 s", 64, int(np.sum(np.asarray(batch.status) == al.Status.SUCCESS)))
    q_d = np.asarray(law.motion(60.0)[0])
    final = np.asarray(batch.q).reshape(64, -1)[:, -2:]
    # The slowest mode decreases by a factor of five in 10 s. The largest error at 60 s is 1.0e-6, and the limit is 100 times larger.
    report.bound("largest |e| (m, rad) at 60 s", np.abs(final - q_d).max(), 1e-4)
