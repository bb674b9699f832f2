"""Adaptive tracking, written from its equations; e = q_d - q, and C is the Coriolis matrix of the Christoffel symbols.

    v_r = v_d + Lambda e,  Lambda = Kd^-1 Kp,  s = v_r - v,  a_r = a_d + Lambda e_dot
    tau = Y(q, v, v_r, a_r) pi_hat + Kp e + Kd e_dot, plus armature a_r if it is not estimated            (Slotine and Li 1987)
    pi_hat_dot = Gamma w,  w = Y's, or a rate of `adaptation`
    columns of Y        inertial, then diag(a_r), diag(v_r), diag(tanh(v_r/v_s)), diag(exp(-(v_r/v_s)^2) tanh(v_r/v_s))
    leakage             w = Y's - sigma (pi_hat - pi_0), pi_0 the centre; e-modification: sigma |s|   (Ioannou 1984, Narendra 1987)
    dead zone           w = 0 while |s| is below the size of the zone
    composite           w = Y's + W'R e_W,   e_W = tau_W - W pi_hat,  W_dot = Y(q, v, v, v_dot) - lambda W,  tau_W_dot = tau - lambda tau_W
                                                                                                           (Slotine and Li 1989)
    concurrent          w = Y's + sum_j W_j'R (tau_j - W_j pi_hat) of stored samples                 (Chowdhary and Johnson 2010)
    Lyapunov function   -V1_dot = s'(tau - (M a_r + C v_r + g + tau_f(v))) + (pi - pi_hat)'w,  without projection and external force

q_d, v_d, a_d are the desired motion, and Kp and Kd the gains. Y is the regressor of the estimated parameters pi_hat. Gamma is the
adaptation gain, sigma the leakage, and v_s the friction speed. Composite and concurrent adaptation have separate weights R. lambda is the
rate of the filters, and v_dot the acceleration of the plant. If armature is not estimated, the filter of tau receives tau - armature v_dot.
In the last row, M, C, g, the friction torque tau_f and the true parameters pi are those of the plant. ' is the transpose, and _dot the time
derivative.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .adaptation import divergence, least_bodies, natural_rate, nearest_start, projected_rate
from .identification import BaseParameters
from .lagrange import Array, Mechanism, solve
from .law import Law, Terms, gain
from .motion import Motion

KINDS = ("armature", "viscous", "coulomb", "stribeck", "offset")


def columns(v_r: Array, a_r: Array, v_s: Array, kinds: Iterable[str], constant: float = 1.0) -> Array:
    """The regressor columns of joint parameters, (n, kinds n): n columns for each of `kinds`. `constant` is the entry of an offset."""
    share = v_r / v_s
    entries = {
        "armature": a_r,
        "viscous": v_r,
        "coulomb": np.tanh(share),
        "stribeck": np.exp(-(share**2)) * np.tanh(share),
        "offset": np.full(v_r.size, constant),
    }
    return np.hstack([np.zeros((v_r.size, 0)), *(np.diag(entries[kind]) for kind in kinds)])


class Adaptive(Law):
    """The tracking law of Slotine and Li. Its state is the estimate pi_hat, and then the filters of composite adaptation.

    The estimate has all inertial parameters or a base set of them, and then the joint parameters.
    """

    def __init__(
        self,
        arm: Mechanism,
        motion: Motion,
        kp: ArrayLike,
        kd: ArrayLike,
        gamma: ArrayLike,
        estimate: ArrayLike | None = None,
        *,
        base: BaseParameters | None = None,
        natural: bool = False,
        projection: ArrayLike | None = None,
        friction: bool | tuple[str, ...] = False,
        armature: bool = False,
        friction_speed: ArrayLike = 0.1,
        leakage: float = 0.0,
        leakage_form: str = "sigma",
        leakage_centre: ArrayLike | None = None,
        dead_zone: float = 0.0,
        composite: ArrayLike | None = None,
        composite_rate: float = 10.0,
        concurrent: Any = None,
        concurrent_weight: ArrayLike = 1.0,
        offset: bool = False,
    ) -> None:
        rubbing = ("viscous", "coulomb") if friction is True else friction or ()
        constant = {"armature": armature, "offset": offset}
        self.kinds = [kind for kind in KINDS if kind in rubbing or constant.get(kind, False)]
        self.v_s = np.broadcast_to(np.asarray(friction_speed, dtype=np.float64), (arm.n,))
        self.columns = np.arange(arm.parameters.size) if base is None else base.columns
        self.projector = np.eye(self.columns.size) if base is None else base.projection
        self.inertial = self.columns.size
        p = self.inertial + arm.n * len(self.kinds)
        self.arm, self.motion, self.natural = arm, motion, natural
        bodies = self.inertial // 10
        self.kp, self.kd = gain(kp, arm.n), gain(kd, arm.n)
        self.gamma = gain(gamma, bodies + p - self.inertial if natural else p)
        self.slope = solve(self.kd, self.kp)
        self.state0 = np.zeros(p) if estimate is None else np.array(estimate, dtype=np.float64)
        self.least = None if projection is None else least_bodies(projection, self.inertial)
        if self.least is not None:
            self.state0[: self.inertial] = nearest_start(self.state0[: self.inertial], self.least)
        self.leakage, self.form, self.dead_zone = leakage, leakage_form, dead_zone
        self.centre = self.state0.copy() if leakage_centre is None else np.asarray(leakage_centre, dtype=np.float64)
        self.weight, self.rate = (None if composite is None else gain(composite, arm.n)), composite_rate
        self.stored, self.trust = concurrent, gain(concurrent_weight, arm.n)
        self.plain = not self.kinds and leakage == 0.0 and dead_zone == 0.0 and composite is None and concurrent is None
        self.p = p
        self.plant: Any = None
        if self.weight is not None:
            self.state0 = np.concatenate([self.state0, np.zeros(arm.n * p + arm.n)])
        self.breaks = getattr(motion, "breaks", ())

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        state = self.state0 if state is None else state
        estimate = state[: self.p]
        q_d, v_d, a_d = self.motion(t)
        e, e_dot = q_d - q, v_d - v
        v_r, a_r = v_d + self.slope @ e, a_d + self.slope @ e_dot
        s = v_r - v
        Y = np.hstack([self.arm.regressor(q, v, v_r, a_r)[:, self.columns], columns(v_r, a_r, self.v_s, self.kinds)])
        known = np.zeros(self.arm.n) if "armature" in self.kinds else self.arm.armature * a_r
        tau = Y @ estimate + known + self.kp @ e + self.kd @ e_dot
        weight = self.leakage * (float(np.linalg.norm(s)) if self.form == "e" else 1.0)
        w = Y.T @ s - (weight * (estimate - self.centre) if weight else 0.0)
        filters = self._filters(q, v, tau, state)
        if filters:
            w = w + filters["W"].T @ self.weight @ filters["e_W"]
        if self.stored is not None:
            for W, torque in zip(self.stored.W, self.stored.tau, strict=True):
                w = w + W.T @ self.trust @ (torque - W @ estimate)
        rate = self._rate(estimate, w)
        if np.linalg.norm(s) < self.dead_zone:
            w, rate = np.zeros_like(w), np.zeros_like(w)
        rate = np.concatenate([rate, *filters.pop("rates", [])])
        parts = {"tau": tau, "u": tau, "state_rate": rate, "w": w, "Y": Y, "s": s, "e": e, "e_dot": e_dot}
        return parts | filters | {"v_r": v_r, "a_r": a_r}

    def _filters(self, q: Array, v: Array, tau: Array, state: Array) -> dict[str, Any]:
        """W, tau_W, e_W, and the time derivatives of W and tau_W; empty without composite adaptation."""
        n, p, arm = self.arm.n, self.p, self.arm
        if self.weight is None:
            return {}
        if self.plant is None:
            a = arm.forward_dynamics(q, v, tau)
        else:
            a = self.plant.rates(np.concatenate([q, v]), tau, np.zeros(n))[n:]
        W, tau_W = state[p : p + n * p].reshape(n, p), state[p + n * p :]
        now = np.hstack([arm.regressor(q, v, v, a)[:, self.columns], columns(v, a, self.v_s, self.kinds)])
        known = np.zeros(n) if "armature" in self.kinds else arm.armature * a
        rates = [(now - self.rate * W).ravel(), tau - known - self.rate * tau_W]
        return {"W": W, "tau_W": tau_W, "e_W": tau_W - W @ state[:p], "rates": rates}

    def _rate(self, estimate: Array, w: Array) -> Array:
        own = self.inertial
        if self.natural:
            speed = np.diag(self.gamma)
            return np.concatenate([natural_rate(estimate[:own], w[:own], speed[: own // 10]), speed[own // 10 :] * w[own:]])
        return projected_rate(self.gamma, estimate, w, self.least) if self.least is not None else self.gamma @ w

    def truth(self, plant: Any) -> Array:
        """The plant's true values of the estimated parameters."""
        arm = plant.arm
        acts = 1.0 if getattr(plant, "friction", False) else 0.0
        of_joints = {"armature": arm.armature, "viscous": acts * arm.damping, "coulomb": acts * arm.friction}
        return np.concatenate([self.projector @ arm.parameters, *(of_joints.get(kind, np.zeros(arm.n)) for kind in self.kinds)])

    def loss(self, terms: Terms, q: Array, v: Array, state: Array, plant: Any) -> float:
        """The rate -V1_dot that theory predicts without projection and external force."""
        s, arm = terms["s"], plant.arm
        if self.plain:
            return float(s @ self.kd @ s)
        needed = arm.regressor(q, v, terms["v_r"], terms["a_r"]) @ arm.parameters + arm.armature * terms["a_r"]
        if getattr(plant, "friction", False):
            needed = needed + arm.friction_torque(v)
        return float(s @ (terms["u"] - needed) + (self.truth(plant) - state[: self.p]) @ terms["w"])

    def lyapunov(self, t: float, q: Array, v: Array, state: Array, plant: Any) -> float:
        """V1 = s'Ms/2 + d'Gamma^-1 d/2 with d = pi - pi_hat, and with M and the parameters pi of the plant.

        In the natural metric, the second term is the sum of each body's distance d(P || P_hat) divided by its gamma.
        """
        s, own = self.terms(t, q, v, state=state)["s"], self.inertial
        truth, state = self.truth(plant), state[: self.p]
        d = truth - state
        if self.natural:
            speed = np.diag(self.gamma)
            of_bodies = np.sum(divergence(truth[:own], state[:own]) / speed[: own // 10])
            rest = float(of_bodies + 0.5 * np.sum(d[own:] ** 2 / speed[own // 10 :]))
        else:
            rest = float(0.5 * d @ solve(self.gamma, d))
        return float(0.5 * s @ plant.arm.mass_matrix(q) @ s) + rest
