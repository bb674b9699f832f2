"""Rotations as unit quaternions `[w, x, y, z]`, for curves of poses.

rotation by the angle a about the unit vector n:   q = [cos a/2, sin a/2 n],   rotation vector r = a n
slerp from q_0 to q_1 at the fraction u:           q_0 exp(u log(q_0^-1 q_1))
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["after", "angle", "inverse", "of_matrix", "of_vector", "slerp", "vector"]

_Array = NDArray[Any]


def of_vector(r: _Array) -> _Array:
    """Quaternions (..., 4) of rotation vectors (..., 3), rad."""
    half = 0.5 * np.linalg.norm(r, axis=-1, keepdims=True)
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * r], axis=-1)


def vector(q: _Array) -> _Array:
    """Rotation vectors (..., 3), rad, of quaternions (..., 4). Their norm is at most pi."""
    q = np.where(q[..., :1] < 0.0, -q, q)
    size = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    small = size < 1e-150
    turn = np.where(small, 2.0, 2.0 * np.arctan2(size, q[..., :1]) / np.where(small, 1.0, size))
    return np.asarray(turn * q[..., 1:])


def of_matrix(matrices: _Array) -> _Array:
    """Quaternions (..., 4) of rotation matrices (..., 3, 3). Of four formulas, the one with the largest divisor is used (Shepperd)."""
    m = np.asarray(matrices)
    trace = np.trace(m, axis1=-2, axis2=-1)
    diagonal = np.diagonal(m, axis1=-2, axis2=-1)
    found = np.empty((*m.shape[:-2], 4))
    found[..., 0] = 1.0 + trace
    found[..., 1:] = 1.0 - trace[..., None] + 2.0 * diagonal
    largest = np.argmax(found, axis=-1)
    forms = np.empty((*m.shape[:-2], 4, 4))
    across = [m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]]
    for i in range(4):
        forms[..., i, i] = found[..., i]
    for i in range(3):
        forms[..., 0, i + 1] = forms[..., i + 1, 0] = across[i]
        for j in range(i):
            forms[..., i + 1, j + 1] = forms[..., j + 1, i + 1] = m[..., i, j] + m[..., j, i]
    chosen = np.take_along_axis(forms, largest[..., None, None], axis=-2)[..., 0, :]
    return np.asarray(chosen / np.linalg.norm(chosen, axis=-1, keepdims=True))


def after(a: _Array, b: _Array) -> _Array:
    """The quaternion product a b, (..., 4)."""
    w = a[..., :1] * b[..., :1] - (a[..., 1:] * b[..., 1:]).sum(axis=-1, keepdims=True)
    return np.concatenate([w, a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])], axis=-1)


def inverse(q: _Array) -> _Array:
    """The inverse rotations, (..., 4)."""
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0]))


def _between(a: _Array, b: _Array) -> _Array:
    """Rotation vectors (..., 3), rad, from `a` to `b`, in the axes of `a`."""
    return vector(after(inverse(a), b))


def slerp(a: _Array, b: _Array, u: _Array) -> _Array:
    """Points (..., 4) of the geodesic from `a` to `b` at the fractions `u` (...,)."""
    return after(a, of_vector(u[..., None] * _between(a, b)))


def angle(a: _Array, b: _Array) -> _Array:
    """Angles (...,), rad, between the rotations `a` and `b`."""
    return np.asarray(np.linalg.norm(_between(a, b), axis=-1))
