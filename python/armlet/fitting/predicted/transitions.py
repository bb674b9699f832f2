"""Transitions of a plant from sample to sample under a recorded torque, with their derivatives.

    x_(k+1) = F(x_k, p),   Phi_k = dF/dx,   G_k = dF/dp

The torque is constant between its switching times. So `F` has one step of a Runge-Kutta method for each piece, or several if the plant is
fast. The derivatives are those of these steps. A switching time moves with the delay: the pieces before and after it have the
derivatives 1 and -1 of their lengths. The sign of Coulomb friction is that of the filtered velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .inputs import Piece
from .plant_numbers import PlantNumbers

__all__ = ["Motion", "Transitions", "transitions"]

Array = NDArray[np.float64]

#: Samples that are computed at once.
CHUNK = 1024
#: Largest product of the fastest eigenvalue and the step: of the midpoint rule, and of the method of order four.
SLOW, FAST = 0.05, 0.5
#: Nodes and weights of the midpoint rule and of the method of order four.
MIDPOINT = ((0.0, 0.5), (0.0, 1.0))
ORDER_FOUR = ((0.0, 0.5, 0.5, 1.0), (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0))


@dataclass(frozen=True)
class Transitions:
    """The states after each sample interval, (K, d), and their derivatives by the state, (K, d, d), and by the values, (K, d, P)."""

    F: Array
    Phi: Array
    G: Array


class Motion:
    """The equations of motion of the plant with the values `beta`. Without `derivatives` P is zero in all results."""

    def __init__(self, numbers: PlantNumbers, beta: Array, derivatives: bool = True) -> None:
        self.numbers, self.all = numbers, numbers.all_of(beta)
        D = numbers.D if derivatives else numbers.D[:, :0]
        self.arm = numbers.arm_of(self.all)
        self.n, self.size = numbers.n, (4 if numbers.elastic else 2) * numbers.n
        self.of = {name: self.all[place] for name, place in numbers.places.items()}
        self.bodies = D[: numbers.p]
        self.by = {name: D[place] for name, place in numbers.places.items() if np.any(D[place])}
        self.late = D[numbers.late]

    def _terms(self, columns: dict[str, Array]) -> Array:
        """The derivatives (K, n, P) of torques: `columns` has the factors (K, n) of the numbers of joints."""
        shape = (len(next(iter(columns.values()))), self.n, len(self.late))
        terms = [np.einsum("kj,jp->kjp", values, self.by[name]) for name, values in columns.items() if name in self.by]
        return np.asarray(sum(terms, np.zeros(shape)))

    def slopes(self, x: Array, u: Array, sign: Array, rate: Array | None = None) -> tuple[Array, Array, Array]:
        """The derivative in time (K, d) of the states `x`, and its derivatives by the state and by the values.

        `u` are the recorded torques, (K, n), and `rate` their derivatives by the delay.
        """
        n, of = self.n, self.of
        q, v = x[:, :n], x[:, n : 2 * n]
        motor = x[:, 3 * n :] if self.numbers.elastic else v
        ones = np.ones_like(q)
        drive = of["torque_constants"] * u - of["offsets"] - of["viscous"] * motor - of["coulomb"] * sign
        by = self._terms({"torque_constants": u, "offsets": -ones, "viscous": -motor, "coulomb": -sign})
        if rate is not None:
            by += np.einsum("kj,p->kjp", of["torque_constants"] * rate, self.late)
        J, G = np.zeros((len(x), self.size, self.size)), np.zeros((len(x), self.size, len(self.late)))
        J[:, :n, n : 2 * n] = np.eye(n)
        if not self.numbers.elastic:
            a = self.arm.forward_dynamics(q, v, drive)
            A, B = self.arm.linearize(q, v, drive)
            J[:, n:] = A[:, n:]
            J[:, n:, n:] -= B[:, n:] * of["viscous"]
            G[:, n:] = B[:, n:] @ (by + self._terms({"rotors": -a}) - self._bodies(q, v, a))
            return np.concatenate([v, a], axis=1), J, G
        theta, K, D = x[:, 2 * n : 3 * n], of["stiffness"], of["joint_damping"]
        spring = K * (theta - q) + D * (motor - v)
        a = self.arm.forward_dynamics(q, v, spring)
        A, B = self.arm.linearize(q, v, spring)
        alpha = (drive - spring) / of["rotors"]
        by_spring = self._terms({"stiffness": theta - q, "joint_damping": motor - v})
        joint = np.concatenate([np.diag(each) for each in (-K, -D, K, D)], axis=1)
        J[:, n : 2 * n, : 2 * n] = A[:, n:]
        J[:, n : 2 * n] += B[:, n:] @ joint
        J[:, 2 * n : 3 * n, 3 * n :] = np.eye(n)
        J[:, 3 * n :] = -joint / of["rotors"][:, None]
        J[:, 3 * n :, 3 * n :] -= np.diag(of["viscous"] / of["rotors"])
        G[:, n : 2 * n] = B[:, n:] @ (by_spring - self._bodies(q, v, a))
        G[:, 3 * n :] = (by - by_spring + self._terms({"rotors": -alpha})) / of["rotors"][:, None]
        return np.concatenate([v, a, motor, alpha], axis=1), J, G

    def _bodies(self, q: Array, v: Array, a: Array) -> Array:
        return np.asarray(self.arm.regressor(q, v, v, a) @ self.bodies) if np.any(self.bodies) else np.zeros(())

    def torque(self, x: Array, a: Array, sign: Array) -> Array:
        """The recorded torques, (K, n), of a motion with the states `x` and the accelerations `a` of the driven side, (K, n)."""
        n, of = self.n, self.of
        if self.numbers.elastic:
            motor = x[:, 3 * n :]
            load = of["rotors"] * a + of["stiffness"] * (x[:, 2 * n : 3 * n] - x[:, :n]) + of["joint_damping"] * (motor - x[:, n : 2 * n])
        else:
            motor = x[:, n:]
            load = self.arm.inverse_dynamics(x[:, :n], motor, a)
        return np.asarray((load + of["viscous"] * motor + of["coulomb"] * sign + of["offsets"]) / of["torque_constants"])

    def inputs(self, x: Array) -> tuple[Array, Array]:
        """The derivatives of the slope by torques of the motors, and by torques on the links, (K, d, n) each."""
        n = self.n
        Minv = self.arm.linearize(x[:, :n], x[:, n : 2 * n], np.zeros((len(x), n)))[1][:, n:]
        links = np.zeros((len(x), self.size, n))
        links[:, n : 2 * n] = Minv
        if not self.numbers.elastic:
            return links, links
        motors = np.zeros_like(links)
        motors[:, 3 * n :] = np.diag(1.0 / self.of["rotors"])
        return motors, links


def transitions(motion: Motion, x: Array, pieces: Sequence[Piece], sign: Array) -> Transitions:
    """The transitions from the states `x`, (K, d). `sign` are the signs of the velocities, (K, n)."""
    count, d = x.shape
    values = len(motion.late)
    F, Phi, G = np.empty((count, d)), np.empty((count, d, d)), np.empty((count, d, values))
    nodes, weights, steps = _method(motion, x, pieces, sign)
    for begin in range(0, count, CHUNK):
        part = slice(begin, min(begin + CHUNK, count))
        state = x[part]
        tangent = np.zeros((len(state), d, d + values))
        tangent[:, :, :d] = np.eye(d)
        for piece in pieces:
            if not np.any(piece.length[part]):
                continue
            h = piece.length[part] / steps
            moves = None if piece.moves is None else np.einsum("k,p->kp", piece.moves[part] / steps, motion.late)
            rate = None if piece.rate is None else piece.rate[part]
            for _ in range(steps):
                state, tangent = _step(motion, state, tangent, h, moves, piece.torque[part], sign[part], rate, nodes, weights)
        F[part], Phi[part], G[part] = state, tangent[:, :, :d], tangent[:, :, d:]
    return Transitions(F, Phi, G)


def _method(motion: Motion, x: Array, pieces: Sequence[Piece], sign: Array) -> tuple[tuple[float, ...], tuple[float, ...], int]:
    """Nodes, weights and the number of steps per piece, from the eigenvalues at some samples."""
    some = np.linspace(0, len(x) - 1, 20).astype(int)
    J = motion.slopes(x[some], pieces[-1].torque[some], sign[some])[1]
    fast = float(np.abs(np.linalg.eigvals(J)).max()) * max(float(np.median(piece.length)) for piece in pieces)
    return (*MIDPOINT, 1) if fast < SLOW else (*ORDER_FOUR, max(1, min(50, int(np.ceil(fast / FAST)))))


def _step(
    motion: Motion, x: Array, tangent: Array, h: Array, moves: Array | None, u: Array, sign: Array, rate: Array | None,
    nodes: Sequence[float], weights: Sequence[float],
) -> tuple[Array, Array]:  # fmt: skip
    """One step of the length `h`, (K,), with the derivatives `moves` of the length by the values, (K, P), of the state and its tangents."""
    d = x.shape[1]
    slope, turned = np.zeros_like(x), np.zeros_like(tangent)
    after, tangent_after = x.copy(), tangent.copy()
    for node, weight in zip(nodes, weights, strict=True):
        at, tangent_at = (x, tangent) if not node else (x + node * h[:, None] * slope, tangent + node * turned)
        slope, J, G = motion.slopes(at, u, sign, rate)
        # The derivative of the slope times the length.
        turned = J @ tangent_at
        turned[:, :, d:] += G
        turned *= h[:, None, None]
        if moves is not None:
            turned[:, :, d:] += slope[:, :, None] * moves[:, None, :]
        if weight:
            after += weight * h[:, None] * slope
            tangent_after += weight * turned
    return after, tangent_after
