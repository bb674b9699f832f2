"""Coverage of the deviations of `fit_log`: logs of ten arms with noise, quantisation, delay, uneven times and lost samples.

    python tests/identities/coverage_trials.py inverse 100       100 logs of each arm, fitted as an arm
    python tests/identities/coverage_trials.py prediction 10     10 logs of each arm, fitted as a plant

Of the errors of all base parameters, rotors, friction coefficients and offsets, 95 % should be within two reported deviations.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))
import models
import numpy as np
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

PERIOD, DURATION = 0.005, 20.0
KINDS = ("inertia", "rotors", "viscous", "coulomb", "offsets")


def chain(kinds: str, axes: list[list[float]], lengths: list[float], seed: int) -> al.Arm:
    """A chain with random physically possible bodies."""
    rng = np.random.default_rng(seed)
    joints: list[Mapping[str, Any]] = []
    for i, (kind, axis, length) in enumerate(zip(kinds, axes, lengths, strict=True)):
        mass, centre = rng.uniform(1.0, 4.0), rng.uniform(-0.05, 0.2, 3)
        inner = np.diag(rng.uniform(0.02, 0.03, 3)) + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        phi = [mass, *(mass * centre), inner[0, 0], inner[0, 1], inner[1, 1], inner[0, 2], inner[1, 2], inner[2, 2]]
        joints.append({"type": kind, "axis": axis, "xyz": [length, 0.0, 0.0], "name": f"joint{i + 1}", "phi": phi})
    return al.Arm.from_chain(joints, gravity=[0.0, 0.0, -9.81])


X, Y, Z = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]
ARMS = {
    "one link": al.planar_arm([0.5]),
    "2R": models.TWO_LINKS,
    "3R": models.THREE_LINKS,
    "4R": al.planar_arm([0.5, 0.4, 0.3, 0.2]),
    "rail and link": chain("PR", [X, Y], [0.0, 0.2], 1),
    "gantry": chain("PPP", [X, Y, Z], [0.0, 0.0, 0.0], 2),
    "SCARA": chain("RRPR", [Z, Z, Z, Z], [0.0, 0.4, 0.3, 0.0], 3),
    "shoulder": chain("RRR", [Z, Y, X], [0.0, 0.1, 0.3], 4),
    "six axes": models.SIX_AXES,
    "seven axes": models.SEVEN_AXES,
}


def trial(name: str, seed: int, predicted: bool) -> Array:
    """The errors of one fit divided by its deviations, without parameters that the log does not determine."""
    arm, rng = ARMS[name], np.random.default_rng([sorted(ARMS).index(name), seed])
    n = arm.n
    rotors, viscous, coulomb, offset = (rng.uniform(low, high, n) for low, high in ((0.1, 0.3), (0.5, 1.5), (0.5, 1.5), (-1.0, 1.0)))
    known = arm.with_drives(armature=rotors, damping=viscous, friction=coulomb)
    motion = al.Sinusoid(
        np.zeros(n), rng.uniform(0.2, 0.4, (n, 3)), 2.0 * np.pi * rng.uniform([0.1, 0.25, 0.5], [0.2, 0.45, 0.75], (n, 3)),
        rng.uniform(0.0, 2.0 * np.pi, (n, 3)),
    )  # fmt: skip
    delay = PERIOD * int(rng.integers(0, 4))
    t = PERIOD * np.arange(round(DURATION / PERIOD)) + 0.02 * PERIOD * rng.uniform(-1.0, 1.0, round(DURATION / PERIOD))
    q = motion(t)[0]
    tau = known.inverse_dynamics(*motion(t + delay), friction=True) + offset + 0.3 * rng.normal(size=q.shape)
    step, kept = 2.0 * np.pi / 2**17, rng.uniform(size=len(t)) > 0.01
    log = al.Log(t[kept], step * np.round(q[kept] / step), tau=tau[kept], names=arm.joint_names)
    model = arm.with_drives(armature=0.0, damping=0.0, friction=0.0)
    if predicted:
        fit = al.fit_log(al.RigidArm(model), log, KINDS, delay=delay, held=False)
    else:
        fit = al.fit_log(model, log, KINDS, delay=delay)
    base = arm.base_parameters(armature=True, friction=True, offset=True)
    values = base.projection @ np.concatenate([arm.parameters, rotors, viscous, coulomb, offset])
    truth = np.array([dict(zip(base.grouping, values, strict=True))[each] for each in fit.names])
    found = np.isfinite(fit.deviations)
    return np.asarray((fit.values - truth)[found] / fit.deviations[found])


def main(kind: str, count: int) -> None:
    """Print the coverage of each arm and of all, and the smallest of one parameter."""
    every: list[Array] = []
    for name in ARMS:
        errors = np.array([trial(name, seed, kind == "prediction") for seed in range(count)])
        within = np.abs(errors) < 2.0
        every.append(within.reshape(-1))
        smallest = 100.0 * within.mean(axis=0).min()
        print(f"{name}: {100.0 * within.mean():.1f} % of {within.shape[1]} parameters, smallest {smallest:.0f} %", flush=True)
    print(f"all: {100.0 * np.concatenate(every).mean():.1f} % of {count * len(ARMS)} logs")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
