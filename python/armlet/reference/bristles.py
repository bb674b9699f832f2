"""LuGre friction. Its state is the torque of the bristles, `w = sigma_0 z`, with the deflection z.

w_dot = sigma_0 (v - |v| w / h),   h = F_s + (F_s - F_c) expm1(-(v/v_s)^2) + mu |L|
tau_f = w + (sigma_1/sigma_0) w_dot + sigma_2 v,   stored energy w^2 / (2 sigma_0)

v is the velocity, and L the load of the joint. F_c and F_s are Coulomb and static friction, v_s is the Stribeck speed and mu the load
ratio. sigma_0, sigma_1 and sigma_2 are stiffness, damping and viscous friction.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array


class LuGre(NamedTuple):
    """The arguments of `armlet.LuGre`, scalar or (n,) each."""

    coulomb: ArrayLike
    stiffness: ArrayLike
    damping: ArrayLike = 0.0
    static: ArrayLike | None = None
    stribeck_speed: ArrayLike | None = None
    viscous: ArrayLike = 0.0
    load_ratio: ArrayLike = 0.0

    def level(self, v: Array, load: Array) -> Array:
        """The torque h(v, L) at which the bristles slide, (n,)."""
        coulomb = np.asarray(self.coulomb, dtype=np.float64)
        static = np.asarray(coulomb if self.static is None else self.static, dtype=np.float64)
        speed = np.asarray(np.inf if self.stribeck_speed is None else self.stribeck_speed, dtype=np.float64)
        level: Array = static + (static - coulomb) * np.expm1(-((v / speed) ** 2)) + np.asarray(self.load_ratio) * np.abs(load)
        return level

    def rub(self, v: Array, w: Array, load: Array) -> tuple[Array, Array, float]:
        """The friction torque tau_f (n,), the derivative w_dot (n,), and the lost power, W.

        The state w = sigma_0 z is the torque of the bristles, for the velocity v and the load.
        """
        s0 = np.asarray(self.stiffness, dtype=np.float64)
        rate = s0 * (v - np.abs(v) * w / self.level(v, load))
        torque = w + np.asarray(self.damping) / s0 * rate + np.asarray(self.viscous) * v
        return torque, rate, float(torque @ v - w @ (rate / s0))

    def energy(self, w: Array) -> float:
        return float(np.sum(w**2 / (2.0 * np.asarray(self.stiffness))))

    def deflection(self, w: Array) -> Array:
        """The deflection z of the bristles, (n,), rad or m, from their torque w = sigma_0 z."""
        z: Array = w / np.asarray(self.stiffness, dtype=np.float64)
        return z
