"""Rest-to-rest motions under limits of speed v, acceleration a and jerk j. All joints arrive at the same time.

from rest to the speed w:    t(w) = 2 (w/j)^1/2 if a is not reached, else w/a + a/j;   distance w t(w)/2
one joint, distance D:       w t(w) = D for the largest speed w, found by bisection;   T = 2 t(w)
                             if this w exceeds v:   T = 2 t(v) + (D - v t(v))/v
all joints:                  the longest of these times;   the other joints are slowed down
"""

import numpy as np
from numpy.typing import ArrayLike

from .elastic import bisect
from .lagrange import Array


def _ramp(speed: float, a: float, j: float) -> float:
    """The shortest time from rest to a speed, s."""
    return 2.0 * float(np.sqrt(speed / j)) if speed <= a * a / j else speed / a + a / j


def duration(distance: float, v: float, a: float, j: float) -> float:
    """The shortest time of one joint for a distance, s."""
    if distance <= v * _ramp(v, a, j):
        return 2.0 * _ramp(bisect(lambda w: w * _ramp(w, a, j) < distance, 0.0, v), a, j) if distance > 0.0 else 0.0
    return 2.0 * _ramp(v, a, j) + (distance - v * _ramp(v, a, j)) / v


def point_to_point(q0: ArrayLike, q1: ArrayLike, v_max: ArrayLike, a_max: ArrayLike, j_max: ArrayLike) -> Array:
    """The shortest time of each joint, (n,), s. The duration of the motion is the largest of them."""
    displacement = np.abs(np.asarray(q1, dtype=np.float64) - np.asarray(q0, dtype=np.float64))
    limits = (np.broadcast_to(np.asarray(x, dtype=np.float64), displacement.shape) for x in (v_max, a_max, j_max))
    return np.array([duration(*map(float, row)) for row in zip(displacement, *limits, strict=True)])
