"""What a `mujoco.MjModel` says in more than one place: gravity, and what actuators add to the joints they drive."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]


def gravity(model: Any) -> _Array:
    """Gravity as the model's dynamics have it, (3,), m/s^2: none where its flag disables it."""
    # A model is given, so its library is there.
    disabled = int(import_module("mujoco").mjtDisableBit.mjDSBL_GRAVITY)
    return np.zeros(3) if model.opt.disableflags & disabled else np.array(model.opt.gravity, dtype=float)


def motors(model: Any) -> tuple[_Array, _Array]:
    """Armature and damping that actuators add to each joint, (njnt,) each: those of a motor times the gear squared."""
    armature, damping = np.zeros((2, model.njnt))
    for k in range(model.nu):
        # Transmissions to a joint, in its own or in its parent's axes, which for hinges and slides is one number.
        if int(model.actuator_trntype[k]) in (0, 1):
            joint, gear = model.actuator_trnid[k, 0], float(model.actuator_gear[k, 0])
            # Attributes of actuators since MuJoCo 4.
            if hasattr(model, "actuator_armature"):
                armature[joint] += gear**2 * float(model.actuator_armature[k])
            if hasattr(model, "actuator_damping"):
                damping[joint] += gear**2 * float(model.actuator_damping[k])
    return armature, damping
