"""Arms that many tests use, their equations of motion in closed form, and known solutions.

Chains of links on a vertical plane, in the absolute angles `phi = T q` of the links:

    M_phi[i, j] = h_ij cos(phi_i - phi_j),   bias_phi[i] = sum_j h_ij sin(phi_i - phi_j) phi_dot_j^2 + b_i g cos(phi_i)
    h_ii = I_i + m_i c_i^2 + mu_i l_i^2,     h_ij = l_i (m_j c_j + mu_j l_j) for i < j,     b_i = m_i c_i + mu_i l_i

with the mass `mu_i` of the links after link i. Then `M = T' M_phi T` and `bias = T' bias_phi`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipeinc, ellipj

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]

#: The robot with a prismatic and a revolute joint on a horizontal plane: A in kg, B in kg m, C in kg m^2.
PR = al.planar_pr(2.0, 0.5, 0.5)
REFERENCE_PR = ref.planar_pr(2.0, 0.5, 0.5)
#: Uniform rods of 0.5 m and 0.4 m (and 0.3 m), of 1 kg per metre.
TWO_LINKS = al.planar_arm([0.5, 0.4])
REFERENCE_TWO_LINKS = ref.planar_arm([0.5, 0.4])
THREE_LINKS = al.planar_arm([0.5, 0.4, 0.3])
REFERENCE_THREE_LINKS = ref.planar_arm([0.5, 0.4, 0.3])
#: Uniform rods of 3 kg and 2 kg.
TWO_HEAVY_LINKS = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0])
#: Inertia 1 kg m^2, gravity moment 5 N m.
PENDULUM = al.pendulum(1.0, 5.0)
SIX_AXES = al.load_urdf(al.example_urdf("six_axis"))
SEVEN_AXES = al.load_urdf(al.example_urdf("seven_axis"))


def links_torque(lengths: list[float], masses: list[float], q: Array, v: Array, a: Array) -> Array:
    """Joint torques (.., n), N m, of uniform rods with the given motion (each (.., n)); gravity 9.81 m/s^2 along -y."""
    length, mass = np.array(lengths), np.array(masses)
    later = mass.sum() - np.cumsum(mass)
    reach = mass * length / 2 + later * length
    h = np.triu(np.outer(length, reach), 1)
    h += h.T + np.diag(mass * length**2 / 3 + later * length**2)
    to_absolute = np.tri(len(length))
    phi, phi_dot, phi_ddot = (np.asarray(x) @ to_absolute.T for x in (q, v, a))
    between = phi[..., :, None] - phi[..., None, :]
    moments = (h * np.cos(between)) @ phi_ddot[..., None] + (h * np.sin(between)) @ phi_dot[..., None] ** 2
    return np.asarray((moments[..., 0] + 9.81 * reach * np.cos(phi)) @ to_absolute)


def pr_torque(A: float, B: float, C: float, q: Array, v: Array, a: Array) -> Array:
    """Force, N, and torque, N m, of the robot PR with the given motion (each (2,))."""
    cos, sin = np.cos(q[1]), np.sin(q[1])
    return np.array([A * a[0] + B * (cos * a[1] - sin * v[1] ** 2), B * cos * a[0] + C * a[1]])


def pendulum_swing(inertia: float, gravity_moment: float, q0: float, t: Array) -> Array:
    """Angles, rad, of a pendulum at the times `t`, s, without torque, released at the angle `q0` at time zero.

    `sin(q/2) = k cd(w t)` with `k = sin(q0/2)`, `w^2 = gravity_moment / inertia` and Jacobi's function cd of modulus k.
    """
    k = np.sin(q0 / 2)
    _, cn, dn, _ = ellipj(np.sqrt(gravity_moment / inertia) * t, k**2)
    return np.asarray(2 * np.arcsin(k * cn / dn))


def pr_drift(A: float, B: float, C: float, q0: Array, v0: Array, q2: Array) -> tuple[Array, Array]:
    """Times, s, and positions q1, m, at which the robot PR without forces reaches the increasing angles `q2`, rad.

    The momentum `A v1 + B cos(q2) v2` and the speed `v2 sqrt(C - B^2 cos^2(q2) / A)` are constant. The time is an elliptic integral of the
    second kind.
    """
    modulus = B**2 / (A * C)
    speed = v0[1] * np.sqrt(1 - modulus * np.cos(q0[1]) ** 2)
    t = (ellipeinc(q2 + np.pi / 2, modulus) - ellipeinc(q0[1] + np.pi / 2, modulus)) / speed
    momentum = A * v0[0] + B * np.cos(q0[1]) * v0[1]
    return np.asarray(t), np.asarray(q0[0] + (momentum * t - B * (np.sin(q2) - np.sin(q0[1]))) / A)


#: Name, arm, arm of the reference, and the torque in closed form.
CLOSED_FORMS: list[tuple[str, al.Arm, Any, Any]] = [
    ("PR", PR, REFERENCE_PR, lambda *motion: pr_torque(2.0, 0.5, 0.5, *motion)),
    ("two links", TWO_LINKS, REFERENCE_TWO_LINKS, lambda *motion: links_torque([0.5, 0.4], [0.5, 0.4], *motion)),
    ("three links", THREE_LINKS, REFERENCE_THREE_LINKS, lambda *motion: links_torque([0.5, 0.4, 0.3], [0.5, 0.4, 0.3], *motion)),
    (
        "two heavy links",
        TWO_HEAVY_LINKS,
        ref.planar_arm([0.5, 0.4], masses=[3.0, 2.0]),
        lambda *motion: links_torque([0.5, 0.4], [3.0, 2.0], *motion),
    ),
    ("pendulum", PENDULUM, ref.pendulum(1.0, 5.0), lambda q, v, a: a + 5.0 * np.sin(q)),
]
