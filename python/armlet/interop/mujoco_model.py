"""Quantities of a `mujoco.MjModel` that depend on several of its fields: gravity, motors of joints, and constraints between joints."""

from __future__ import annotations

from collections.abc import Collection
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]


def gravity(model: Any) -> _Array:
    """Gravity of the model's dynamics, (3,), m/s^2. It is zero if the model's flag disables it."""
    # The import succeeds, because the caller's model is an object of mujoco.
    disabled = int(import_module("mujoco").mjtDisableBit.mjDSBL_GRAVITY)
    return np.zeros(3) if model.opt.disableflags & disabled else np.array(model.opt.gravity, dtype=float)


def motors(model: Any) -> tuple[_Array, _Array]:
    """Armature and damping that actuators add to each joint, (njnt,) each: the actuator's value times the gear ratio squared."""
    armature, damping = np.zeros((2, model.njnt))
    for k in range(model.nu):
        # Transmissions of the types 0 (joint axes) and 1 (axes of the parent) drive a joint. For hinges and slides they have one gear.
        if int(model.actuator_trntype[k]) in (0, 1):
            joint, gear = model.actuator_trnid[k, 0], float(model.actuator_gear[k, 0])
            # Older versions of MuJoCo do not have these attributes.
            if hasattr(model, "actuator_armature"):
                armature[joint] += gear**2 * float(model.actuator_armature[k])
            if hasattr(model, "actuator_damping"):
                damping[joint] += gear**2 * float(model.actuator_damping[k])
    return armature, damping


def followers(model: Any) -> tuple[dict[int, tuple[int, float, float]], list[int]]:
    """Joints that follow a leader, `q = multiplier q_leader + offset`: for each index, the leader's index, multiplier and offset.

    The second result has the indices of the constraints that these joints come from.

    An equality constraint of joints is `y - y0 = a0 + a1 (x - x0) + a2 (x - x0)^2 + ..`, for the positions `y` of a joint and `x` of its
    leader, with the references `y0` and `x0`. armlet uses a constraint that is active and linear. If several constraints have the same
    joint `y`, only the first one is used. A constraint by which a joint would follow itself through other joints is dropped.
    """
    kind = int(import_module("mujoco").mjtEq.mjEQ_JOINT)
    found: dict[int, tuple[int, float, float]] = {}
    used = []
    for k in range(model.neq):
        joint, leader = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        polynomial = np.asarray(model.eq_data[k][:5], dtype=float)
        if int(model.eq_type[k]) != kind or not model.eq_active0[k] or leader < 0 or joint in found or np.any(polynomial[2:] != 0.0):
            continue
        root = leader
        while root in found:
            root = found[root][0]
        if root == joint:
            continue
        y0, x0 = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (joint, leader))
        found[joint] = (leader, float(polynomial[1]), float(polynomial[0] - polynomial[1] * x0 + y0))
        used.append(k)
    return found, used


def lost_constraints(model: Any, used: Collection[int]) -> list[str]:
    """The type and the name of each active equality constraint whose index is not in `used`."""
    kinds = import_module("mujoco").mjtEq
    lost = [k for k in range(model.neq) if model.eq_active0[k] and k not in used]
    return [f"{kinds(int(model.eq_type[k])).name.removeprefix('mjEQ_').lower()} {model.equality(k).name or k}" for k in lost]
