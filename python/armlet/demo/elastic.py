"""System 3: Cartesian impedance of a 2R arm with elastic joints, by motor-inertia reduction.

    M a + C v + g = tau_J + J'F,   B theta_ddot + tau_J = tau,   tau_J = K_J (theta - q)
    tau = (1 - B B0^-1) tau_J + B B0^-1 (u - D0 theta_dot),   u = J'[K_m (x_d - x) - D_m J v] + g(q)

B is the motor inertia and K_J the joint stiffness. B0 and D0 are the reduced inertia of the motors and its damping. K_m and D_m are
Cartesian stiffness and damping. F is the external force at the tip x with the Jacobian J and the target x_d, and ' is the transpose. The
arm moves in a vertical plane, with gravity along -y. At equilibrium x_E = x_d + K_m^-1 F and tau_E = g(q_E) - J'F, if x_E is reachable and
regular, and the loop is stable. Numbers such as E9 are errata of the exam (docs/exam.md).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

import armlet as al

from . import impedance

if TYPE_CHECKING:
    from collections.abc import Callable

    from .report import Report

TITLE = "System 3: elastic joints, motor-inertia reduction and Cartesian impedance"

Array: TypeAlias = NDArray[np.float64]

K_J, B, B0 = np.array([800.0, 500.0]), np.array([0.4, 0.25]), np.array([0.02, 0.0125])
K_M, D_M = np.array([300.0, 200.0]), np.array([40.0, 30.0])
X_D = np.array([0.505963125229884173856431054358, 0.546758097972291559929349721299])
Q0, FORCE = (0.3, 1.2), np.array([10.0, -15.0])
FRAME: dict[str, Any] = {"frame": "link2", "axes": "xy"}
TIGHT: dict[str, Any] = {"method": "dop853", "rtol": 1e-12, "atol": 1e-12}

# The state (q, v, theta, theta_dot) by time t, from rest in Q0 under FORCE. The values were integrated with 25 digits and rounded to 13.
ORACLE = {
    0.02: (
        0.2982878554708,
        1.195994818169,
        -0.1771066593904,
        -0.2724533555989,
        0.3251381279686,
        1.203496474677,
        0.2587096022862,
        0.09948210081598,
    ),
    0.1: (
        0.2702200829591,
        1.194479170599,
        -0.3855463262159,
        0.07683890968217,
        0.3091901421224,
        1.205133454926,
        -0.3552505714973,
        0.08139679964483,
    ),
    0.5: (
        0.1906726381988,
        1.243392824459,
        -0.0900393489219,
        0.1125377910954,
        0.2290649108434,
        1.254084083209,
        -0.09174470581773,
        0.1116825565671,
    ),
    1.0: (
        0.1645848515667,
        1.282655138982,
        -0.0293317389868,
        0.04974607968376,
        0.2025680167521,
        1.293040013598,
        -0.02972294545174,
        0.04935294490654,
    ),
    2.0: (
        0.151442959736,
        1.305304799009,
        -0.004427651028629,
        0.007664424843312,
        0.1892537313345,
        1.315511130117,
        -0.004485978731874,
        0.007604326173425,
    ),
    5.0: (
        0.1491193676543,
        1.309323315169,
        -1.466471888901e-05,
        2.533561216016e-05,
        0.1868994129756,
        1.319498179857,
        -1.485941162879e-05,
        2.513750865008e-05,
    ),
}
# The tolerance covers the rounding to 13 digits of numbers below 10, and the integrator's error at rtol = atol = 1e-12.
ORACLE_TOLERANCE = 1e-10
# Ratios B0/B of reduced to original motor inertia, from 1/4 to 1/65536. Each ratio is a quarter of the previous one.
SHARES: Array = 0.25 ** np.arange(1.0, 9.0, dtype=np.float64)


def make_arm() -> al.Arm:
    return al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], coms=[0.25, 0.2], inertias=[0.0625, 0.027], gravity=(0.0, -9.81))


def make_law(arm: al.Arm, target: ArrayLike = X_D, reduced: ArrayLike = B0, **options: Any) -> al.ElasticImpedance:
    return al.ElasticImpedance(arm, target, K_M, D_M, K_J, B, reduced, **FRAME, **options)


def tip(arm: al.Arm, q: ArrayLike) -> Array:
    return np.asarray(arm.position(q, "link2"))[..., :2]


def run(report: Report) -> None:
    arm = make_arm()
    plant, law = al.ElasticArm(arm, K_J, B), make_law(arm)
    step = force_step(report, arm, plant, law)
    impedance.run(report, arm, X_D, (K_M, D_M), Q0, FORCE)
    impedance.motors(report, step, K_J, B)
    printed = printed_law(report, arm, step)
    unreachable(report, arm, plant, law)
    anywhere(report, arm, plant)
    errors = reduction(report, arm, plant)
    sampled(report, arm, plant, law)
    report.draw_figure("elastic", lambda figure: draw(figure, arm, law, step, printed, errors))


def force_step(report: Report, arm: al.Arm, plant: al.ElasticArm, law: al.ElasticImpedance) -> al.Run:
    """Check a run after a force step from rest: the 25-digit solution, the equilibrium, and the energy balance."""
    times = list(ORACLE)
    short = al.simulate(plant, law, Q0, t_end=times[-1], t_eval=times, force=FORCE, **TIGHT)
    assert short.theta is not None and short.theta_dot is not None
    states = np.hstack([short.q, short.v, short.theta, short.theta_dot])
    for state, t, expected in zip(states, times, ORACLE.values(), strict=True):
        report.bound(f"(q, v, theta, theta_dot) at {t:g} s minus the 25-digit solution", np.abs(state - expected).max(), ORACLE_TOLERANCE)
    step = al.simulate(plant, law, Q0, t_end=12.0, t_eval=np.linspace(0.0, 12.0, 4801), force=FORCE, **TIGHT)
    rest = al.equilibrium(plant, law, FORCE, q0=Q0)
    q_E, load = step.q[-1], np.asarray(arm.jacobian(step.q[-1], "link2"))[:2].T @ FORCE
    assert step.tau is not None
    # The slowest mode decays with the rate 1.9 1/s, so its amplitude after 12 s is 1e-10 of the initial one.
    report.near("force step F = (10, -15) N: x at 12 s = x_E = x_d + K_m^-1 F (m)", X_D + FORCE / K_M, tip(arm, q_E), 1e-9)
    report.near("equilibrium(): x_E without a simulation (m)", X_D + FORCE / K_M, rest.x, 1e-13)
    gravity = np.asarray(arm.gravity(q_E))
    report.near("tau at 12 s = g(q_E) - J'F (N m)", gravity - load, step.tau[-1], 1e-7, "u_E = J'F + g", "E10")
    wrong = float(np.abs(gravity + load - step.tau[-1]).max())
    report.equal(f"the printed J'F + g is off by {wrong:.1f} N m", True, wrong > 1.0, "u_E = J'F + g", "E10")
    energy = step.monitors["energy"]
    report.near("E(0) (J)", 0.17393085271986963, energy[0], 1e-12)
    # The energy balance is an identity, so its residual is the error of the integrator.
    balance = np.abs(step.monitors["energy_balance"]).max() / energy.max()
    report.bound("energy balance E(t) - E(0) - integral of P, over the largest E", balance, 1e-8)
    return step


def printed_run(arm: al.Arm, u: Callable[[Array, Array, Array], Array], t_end: float, dt: float = 1e-3) -> tuple[Array, Array]:
    """Simulate the elastic arm with the outer law `u`, a function u(q, v, J), N m. The method is RK4 in numpy.

    J is the linear Jacobian of the frame "link2", (2, 2), m. Returns the times (K,), s, and the positions q (K, 2), rad.
    """
    D0 = 2.0 * np.sqrt(B0 * K_J)

    def rate(x: Array) -> Array:
        q, v, theta, theta_dot = x.reshape(4, 2)
        J = np.asarray(arm.jacobian(q, "link2"))[:2]
        spring = K_J * (theta - q)
        tau = spring + B / B0 * (u(q, v, J) - D0 * theta_dot - spring)
        return np.concatenate([v, arm.forward_dynamics(q, v, spring + J.T @ FORCE), theta_dot, (tau - spring) / B])

    x = np.concatenate([Q0, [0.0, 0.0], Q0 + np.asarray(arm.gravity(Q0)) / K_J, [0.0, 0.0]])
    times = dt * np.arange(round(t_end / dt) + 1)
    states = np.full((times.size, 8), np.nan)
    for k in range(times.size):
        states[k] = x
        k1 = rate(x)
        k2 = rate(x + 0.5 * dt * k1)
        k3 = rate(x + 0.5 * dt * k2)
        x = x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(x + dt * k3))
        if not np.abs(x).max() < 1e3:
            break
    positions: Array = states[:, :2]
    return times.astype(np.float64), positions


def printed_law(report: Report, arm: al.Arm, step: al.Run) -> dict[str, tuple[Array, Array]]:
    """Erratum E9: the law printed in the exam lacks the factor J' of the whole bracket, and the factor v after D_m J."""
    x_E = X_D + FORCE / K_M

    def right(q: Array, v: Array, J: Array) -> Array:
        return J.T @ (K_M * (X_D - tip(arm, q)) - D_M * (J @ v)) + np.asarray(arm.gravity(q))

    def without_transpose(q: Array, v: Array, J: Array) -> Array:
        u: Array = K_M * (X_D - tip(arm, q)) - D_M * (J @ v) + np.asarray(arm.gravity(q))
        return u

    def without_velocity(q: Array, v: Array, J: Array) -> Array:
        # The printed law adds the matrix J' D_m J to a vector. Here the sum of its columns replaces the matrix, as if v were (1, 1) rad/s.
        u: Array = J.T @ (K_M * (X_D - tip(arm, q)) - D_M * J.sum(axis=1)) + np.asarray(arm.gravity(q))
        return u

    t_end = 2.0
    runs = {
        name: printed_run(arm, u, t_end)
        for name, u in (("right", right), ("without J'( )", without_transpose), ("without v", without_velocity))
    }
    native = step.q[int(np.searchsorted(step.t, t_end))]
    # RK4 with steps of 1 ms has the error (0.3)^5/120 per step for the fastest modes, 300 1/s, until these modes have decayed.
    report.near("the same loop in numpy (RK4, 1 ms): q at 2 s (rad)", native, runs["right"][1][-1], 1e-6)
    for name in ("without J'( )", "without v"):
        q = runs[name][1]
        late = q[q.shape[0] // 2 :]
        # A diverged run ends in NaN, which counts as a distance of 1 m, more than the reach of the arm.
        miss = float(np.nan_to_num(np.linalg.norm(tip(arm, late) - x_E, axis=1), nan=1.0).max())
        report.equal(f"law {name}: up to {miss:.2g} m from x_E between 1 and 2 s", True, bool(miss > 0.1), "K_m (x_d - f(q)) - D_m J", "E9")
    return runs


def unreachable(report: Report, arm: al.Arm, plant: al.ElasticArm, law: al.ElasticImpedance) -> None:
    """Erratum E11: x_E is the equilibrium only if the arm can reach it, det J is not zero there, and the loop is stable."""
    pulled = al.equilibrium(plant, law, [300.0, 100.0], q0=Q0)
    text = "x_E unconditional"
    report.equal("F = (300, 100) N: x_d + K_m^-1 F reachable", False, pulled.reachable, text, "E11")
    report.near(
        "F = (300, 100) N: tip of the stretched arm at equilibrium (m)",
        (0.784978594517357, 0.4402369886203963),
        pulled.x,
        1e-10,
        text,
        "E11",
    )
    folded = al.ElasticImpedance(arm, 0.6 / 0.9 * tip(arm, [0.3, 0.0]), 250.0, 40.0, K_J, B, B0, **FRAME)
    found = al.equilibrium(plant, folded, q0=[0.3, 0.0])
    size = float(np.linalg.norm(tip(arm, found.q) - 0.6 / 0.9 * tip(arm, [0.3, 0.0])))
    report.near("target in line with the stretched arm: distance of the equilibrium (m)", 0.3, size, 1e-9, text, "E11")
    report.equal("target in line with the stretched arm: kind of the equilibrium", "spurious, unstable", _described(found), text, "E11")
    report.near(
        "target in line with the stretched arm: largest real part of an eigenvalue (1/s)",
        2.510776293363032,
        float(found.eigenvalues.real.max()),
        1e-6,
    )


def _described(found: al.Equilibrium) -> str:
    return f"{'spurious' if found.spurious else 'regular'}, {'stable' if found.stable else 'unstable'}"


def anywhere(report: Report, arm: al.Arm, plant: al.ElasticArm) -> None:
    """Check the equilibrium with random reachable targets and forces."""
    rng = np.random.default_rng(20220610)
    runs, worst_x, worst_tau = 8, 0.0, 0.0
    for _ in range(runs):
        q_d = rng.uniform([-1.0, 0.7], [1.0, 1.8])
        force = rng.uniform(-15.0, 15.0, 2)
        law = make_law(arm, tip(arm, q_d))
        run = al.simulate(plant, law, q_d + rng.uniform(-0.3, 0.3, 2), t_end=30.0, t_eval=[30.0], force=force, **TIGHT)
        assert run.tau is not None
        load = np.asarray(arm.jacobian(run.q[-1], "link2"))[:2].T @ force
        worst_x = max(worst_x, float(np.abs(tip(arm, run.q[-1]) - tip(arm, q_d) - force / K_M).max()))
        worst_tau = max(worst_tau, float(np.abs(run.tau[-1] - arm.gravity(run.q[-1]) + load).max()))
    report.bound(f"{runs} random targets and forces: largest |x - x_d - K_m^-1 F| at 30 s (m)", worst_x, 1e-8)
    report.bound(f"{runs} random targets and forces: largest |tau - g + J'F| at 30 s (N m)", worst_tau, 1e-6)


def distances(arm: al.Arm, plant: al.ElasticArm, shares: Array, **options: Any) -> Array:
    """Largest distance |x - x_rigid|, m, in the 2 s after a force step, for each B0/B. x_rigid is the motion of the rigid arm."""
    times = np.linspace(0.0, 2.0, 2001)
    kinds: dict[str, Any] = {
        "t_end": 2.0,
        "t_eval": times,
        "force": FORCE,
        "method": "dop853",
        "rtol": 1e-9,
        "atol": 1e-11,
        "monitors": False,
    }
    rigid = al.simulate(al.RigidArm(arm), al.CartesianImpedance(arm, X_D, K_M, D_M, **FRAME), Q0, **kinds)
    target = tip(arm, rigid.q)
    runs = (al.simulate(plant, make_law(arm, reduced=share * B, **options), Q0, **kinds) for share in shares)
    return np.array([np.linalg.norm(tip(arm, run.q) - target, axis=1).max() for run in runs])


def reduction(report: Report, arm: al.Arm, plant: al.ElasticArm) -> dict[str, Array]:
    """Erratum E12: to approach the motion of the rigid arm, D0 must decrease with B0. Damping of theta_dot - v reduces the error."""
    text = "a small B0 suffices"
    tied = distances(arm, plant, SHARES)
    # If D0 is fixed, the motors' rate D0/B0 is proportional to 1/B0. The two smallest B0 are left out, because they require short steps.
    fixed = distances(arm, plant, SHARES[:6], motor_damping=2.0 * np.sqrt(B0 * K_J))
    relative = distances(arm, plant, SHARES, relative_damping=True)
    orders = np.diff(np.log(tied)) / np.log(0.25)
    # Both the expected and the actual maxima are over samples at intervals of 1 ms.
    report.near(
        "D0 from zeta and B0: max |x - x_rigid| at B0/B = 1/4, 1/64, 1/65536 (m)", (0.0399765, 0.0220352, 0.00115615), tied[[0, 2, 7]], 1e-5
    )
    report.near("D0 from zeta and B0: order of the error in B0/B, for B0/B below 6e-5", 0.475, orders[-1], 0.025, text, "E12")
    practical = bool(np.all((orders[1:4] > 0.2) & (orders[1:4] < 0.4)))
    report.equal("D0 from zeta and B0: order 0.2 to 0.4 for B0/B from 1/16 to 1/1024", True, practical, text, "E12")
    report.near("D0 fixed: error at B0/B = 1/4096 divided by the error at 1/4", 1.0, fixed[-1] / fixed[0], 0.01, text, "E12")
    gain = float(np.min(tied[1:] / relative[1:]))
    report.equal(f"damping on theta_dot - v: error smaller by {gain:.1f} or more, B0/B <= 1/16", True, gain >= 10.0)
    return {"tied": tied, "fixed": fixed, "relative": relative}


def sampled(report: Report, arm: al.Arm, plant: al.ElasticArm, law: al.ElasticImpedance) -> None:
    """Check the smallest reduced inertia B0 for a sample time, and the largest sample time for a B0."""
    smallest = al.smallest_reduced_inertia(B, K_J, 1e-3)
    report.near("smallest B0 at 1 ms, near K_J dt^2 (kg m^2)", (0.0008002667422419266, 0.0005001667139012043), smallest, 1e-10)
    limit = al.elastic_limits(plant, law, q0=Q0).sample_time_max
    report.near("largest sample time for B0 = B/20 (s), near sqrt(B0/K_J)", np.sqrt(B0[0] / K_J[0]), limit, 5e-5)
    for share, expected in ((0.3, "runs"), (1.01, "InputError")):
        try:
            dt = share * limit
            al.simulate(plant, law, Q0, t_end=100 * dt, dt=dt / 10, sample_time=dt, force=FORCE, monitors=False)
            answer = "runs"
        except al.InputError:
            answer = "InputError"
        report.equal(f"sample time at {share:g} of it", expected, answer)


def draw(
    figure: Any, arm: al.Arm, law: al.ElasticImpedance, step: al.Run, printed: dict[str, tuple[Array, Array]], errors: dict[str, Array]
) -> None:
    """Draw a force step: the tip position and the joint torques over time, and two comparisons.

    The first comparison shows the distance of the tip from x_E over time, under the correct law and the law that the exam prints. The
    second comparison shows the deviation from the motion with rigid joints as a function of B0.
    """
    from ..figures.style import COLOURS

    figure.set_size_inches(12.0, 8.0)
    figure.set_layout_engine("constrained")
    figure.suptitle(
        f"Impedance law of an arm with elastic joints, force step F = ({FORCE[0]:.0f}, {FORCE[1]:.0f}) N at the tip at t = 0", fontsize=11
    )
    (path, torque), (wrong, order) = figure.subplots(2, 2)
    seconds = step.t <= 3.0
    t, x = step.t[seconds], tip(arm, step.q[seconds])
    x_E = X_D + FORCE / K_M
    for k, name in enumerate("xy"):
        path.plot(t, x[:, k], color=COLOURS[k], label=f"${name}$")
        path.axhline(x_E[k], color=COLOURS[k], linestyle="--", linewidth=1.0)
        path.axhline(X_D[k], color=COLOURS[k], linestyle=":", linewidth=1.0)
    for stroke, name in (("--", "equilibrium $x_E$"), (":", "target $x_d$")):
        path.plot([], [], color="0.4", linestyle=stroke, linewidth=1.0, label=name)
    path.set_title("Tip position: converges to $x_E = x_d + K_m^{-1} F$", loc="left", fontsize=10)
    path.set_ylabel("tip position (m)")
    assert step.theta is not None and step.theta_dot is not None
    early = step.t <= 1.0
    rows = zip(step.t[early], step.q[early], step.v[early], step.theta[early], step.theta_dot[early], strict=True)
    parts = [law.terms(t, q, v, theta=theta, theta_dot=theta_dot) for t, q, v, theta, theta_dot in rows]
    for k in range(2):
        torque.plot(step.t[early], [part["tau_J"][k] for part in parts], color=COLOURS[k], label=f"joint torque $\\tau_{{J{k + 1}}}$")
        torque.plot(
            step.t[early],
            [part["u"][k] for part in parts],
            color=COLOURS[k],
            linestyle="--",
            linewidth=1.0,
            label=f"rigid-joint law $u_{k + 1}$",
        )
    load, gravity = np.asarray(arm.jacobian(step.q[-1], "link2"))[:2].T @ FORCE, np.asarray(arm.gravity(step.q[-1]))
    for k in range(2):
        torque.axhline((gravity + load)[k], color=COLOURS[k], linestyle=":", linewidth=1.0)
    torque.plot([], [], color="0.4", linestyle=":", linewidth=1.0, label="$J'F + g$, as in the exam")
    torque.set_title("Joint torques: converge to $g - J'F$, not to $J'F + g$ (erratum E10)", loc="left", fontsize=10)
    torque.set_ylabel("torque (N m)")
    for k, (name, (times, q)) in enumerate(printed.items()):
        wrong.plot(
            times,
            np.linalg.norm(tip(arm, q) - x_E, axis=1),
            color=COLOURS[k],
            label="correct law" if name == "right" else f"law of the exam {name}",
        )
    wrong.set_yscale("log")
    wrong.set_title("Distance from equilibrium: the law of the exam does not reach it (erratum E9)", loc="left", fontsize=10)
    wrong.set_ylabel("distance $|x - x_E|$ (m)")
    names = {
        "tied": "damping $D_0 = 2\\sqrt{B_0 K_J}$",
        "fixed": "$D_0$ fixed",
        "relative": "$D_0 = 2\\sqrt{B_0 K_J}$ on $\\dot\\theta - v$",
    }
    for k, (name, values) in enumerate(errors.items()):
        order.loglog(SHARES[: values.size], values, "o-", color=COLOURS[k], markersize=4, label=names[name])
    order.loglog(SHARES[-4:], 0.6 * errors["tied"][-1] * (SHARES[-4:] / SHARES[-1]) ** 0.5, color="0.5", linewidth=1.0, label="slope 1/2")
    order.set_title("Deviation from rigid joints: small only if $D_0$ is small too (erratum E12)", loc="left", fontsize=10)
    order.set_xlabel("reduced motor inertia / motor inertia, $B_0/B$ (1)")
    order.set_ylabel("largest deviation $|x - x_\\mathrm{rigid}|$ (m)")
    for ax in (path, torque, wrong):
        ax.set_xlabel("time (s)")
    for ax in (path, torque, wrong, order):
        ax.grid(alpha=0.3, linewidth=0.6)
        ax.spines[["top", "right"]].set_visible(False)
        ax.legend(fontsize=8, framealpha=0.9, edgecolor="none", loc="center right" if ax in (path, torque) else "best")
