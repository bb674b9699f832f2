"""The columns of the inverse fit, and the torque of the parameters that are known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .samples import Samples
from .sensors import SENSORS

__all__ = ["KINDS", "columns_of", "known_torque"]

Array = NDArray[np.float64]

#: The kinds of parameters, with the part of a column's name before the joint. Other columns are inertial parameters.
KINDS = ("inertia", "rotors", "viscous", "coulomb", "stribeck", "offsets", *SENSORS)
_OF_COLUMN = {"armature": "rotors", "damping": "viscous", "friction": "coulomb", "stribeck": "stribeck", "offset": "offsets"}


def columns_of(arm: _core.Arm, samples: Samples, kinds: Sequence[str], speed: float) -> tuple[Array, Any, list[int], tuple[str, ...]]:
    """The columns W, (K, n, b), the base parameters, the indices of its columns in W, and the names of all columns."""
    rubs = "viscous" in kinds or "coulomb" in kinds
    base = arm.base_parameters(armature="rotors" in kinds, friction=rubs, offset="offsets" in kinds)
    of_column = [_OF_COLUMN.get(name.partition("[")[0], "inertia") for name in base.names]
    if "inertia" in kinds:
        chosen = [int(k) for k, column in enumerate(base.columns) if of_column[column] in kinds]
        places, labels = [int(base.columns[k]) for k in chosen], [base.grouping[k] for k in chosen]
    else:
        # Without inertial parameters, every column of a joint is independent.
        chosen, places = [], [k for k, kind in enumerate(of_column) if kind in kinds]
        labels = [base.names[k] for k in places]
    full = arm.regressor(samples.q, samples.v, samples.v, samples.a, armature=base.armature, friction=base.friction, offset=base.offset)
    n = arm.n
    first = {kind: of_column.index(kind) for kind in ("coulomb",) if kind in of_column}
    if "coulomb" in first:
        full[:, np.arange(n), first["coulomb"] + np.arange(n)] = samples.filtered(np.sign(samples.motion[1]))
    W = full[..., places]
    if "stribeck" in kinds:
        extra = samples.filtered(np.exp(-((samples.motion[1] / speed) ** 2)) * np.sign(samples.motion[1]))
        W = np.concatenate([W, np.eye(n) * extra[:, None, :]], axis=2)
        labels += [f"stribeck[{name}]" for name in arm.joint_names]
    return W, base, chosen, tuple(labels)


def known_torque(arm: _core.Arm, samples: Samples, kinds: Sequence[str]) -> Array:
    """The torque of the parameters that are not fitted: rotors, and all bodies without "inertia". Friction that is not fitted is zero."""
    n, still = arm.n, np.zeros(arm.n)
    rotors = np.zeros_like(samples.a) if "rotors" in kinds else np.array(arm.limits["armature"]) * samples.a
    if "inertia" in kinds:
        return rotors
    bare = arm.with_drives(armature=still) if n else arm
    return np.asarray(bare.inverse_dynamics(samples.q, samples.v, samples.a) + rotors)
