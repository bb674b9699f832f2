"""The log of a real Franka Emika Panda: the torques of a fit of armlet, beside those of the published model.

    python -P benches/panda_log.py FOLDER               FOLDER is a copy of the public repository FrankaEmikaPandaDynModel
    python -P benches/panda_log.py FOLDER --readme      the table, written into benches/README.md

The log and the model are of Gaz and others (2019), Dynamic identification of the Franka Emika Panda robot. Their licence is GPL-3, so this
script reads the user's copy: 20,544 samples of 21 s, and the formulas of the model as Matlab text. The torques of the models are compared
with the measured torques of the second half of the log, after the same filter.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
import reporting

Array = NDArray[np.float64]

LOG = "matlab/data/Exciting_Traj/Trajectory_1/rbt_log/exciting_traj_{}.txt"
MODEL = "matlab/dyn_model_panda/get_{}.m"
KINDS = ("inertia", "rotors", "viscous", "coulomb", "offsets")
CUTOFF, PERIOD = 10.0, 1e-3  # Hz, s


def panda() -> al.Arm:
    """The arm from the public table of its maker, with bodies of 1 kg, because the fit does not use them."""
    table = [
        (0.0, 0.0, 0.333),
        (0.0, -1.0, 0.0),
        (0.0, 1.0, 0.316),
        (0.0825, 1.0, 0.0),
        (-0.0825, -1.0, 0.384),
        (0.0, 1.0, 0.0),
        (0.088, 1.0, 0.0),
    ]
    body = [1.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.01, 0.0, 0.0, 0.01]
    rows = [{"a": a, "alpha": turn * np.pi / 2, "d": d, "phi": body} for a, turn, d in table]
    return al.Arm.from_dh(rows, convention="modified", gravity=(0.0, 0.0, -9.80665))


def recorded(folder: Path, arm: al.Arm) -> al.Log:
    """The log. Records that repeat the time of the record before are left out."""
    t, q, tau = (np.loadtxt(folder / LOG.format(name)) for name in ("time", "positions", "torques"))
    q, tau = q.reshape(-1, arm.n), tau.reshape(-1, arm.n)
    new = np.concatenate([[True], np.diff(t) > 0.0])
    return al.Log(t[new], q[new], tau=tau[new], names=arm.joint_names)


def formulas(file: Path, result: str, **vectors: Array) -> Array:
    """The entries of `result` of a Matlab function for K samples, (K, entries).

    The function has lines `name = expression;` with names t2, t3, .., and `result = [expression;..];`.
    """
    values: dict[str, Any] = {"cos": np.cos, "sin": np.sin}
    values |= {f"{name}{i + 1}": x[:, i] for name, x in vectors.items() for i in range(x.shape[1])}
    count = len(next(iter(vectors.values())))
    for name, expression in re.findall(r"^(\w+) = (.*);", file.read_text(), re.MULTILINE):
        if name in values:  # such as q1 = q(1)
            continue
        python = expression.replace(".^", "**").replace(".*", "*").replace("./", "/")
        parts = [eval(part, {"__builtins__": {}}, values) for part in python.strip("[]").split(";")]
        if name == result:
            return np.stack([np.broadcast_to(part, count) for part in parts], axis=1)
        values[name] = parts[0]
    raise ValueError(f"{file} has no {result}")


def published(folder: Path, q: Array, v: Array, a: Array) -> Array:
    """Torques of the published model, (K, 7), N m."""
    gravity = formulas(folder / MODEL.format("GravityVector"), "g_li_hat", q=q)
    coriolis = formulas(folder / MODEL.format("CoriolisVector"), "cqdq", q=q, dq=v)
    lower = formulas(folder / MODEL.format("MassMatrix"), "Bstack_hat", q=q)  # rows of the lower triangle
    mass = np.zeros((len(q), 7, 7))
    rows, columns = np.tril_indices(7)
    mass[:, rows, columns] = mass[:, columns, rows] = lower
    # The friction of a joint is a logistic function of its velocity, with rows of sizes, zeros, shifts and slopes.
    text = (folder / MODEL.format("FrictionTorque")).read_text()
    table = [[float(x) for x in row.split(",")] for row in re.findall(r"^\s*([-\d.]+(?:,[-\d.]+){6})", text, re.MULTILINE)]
    size, _, shift, slope = np.array(table)
    friction = size / (1.0 + np.exp(-slope * (v + shift))) - size / (1.0 + np.exp(-slope * shift))
    return np.asarray(np.einsum("kij,kj->ki", mass, a) + coriolis + gravity + friction)


def main() -> None:
    parser = reporting.arguments("the log of a Panda")
    parser.add_argument("folder", type=Path, help="a copy of the repository FrankaEmikaPandaDynModel")
    options = parser.parse_args()
    arm = panda()
    log = recorded(options.folder, arm)
    half = log.t[-1] / 2
    fits = {
        "whole log": al.fit_log(arm, log, KINDS, cutoff=CUTOFF),
        "first half": al.fit_log(arm, log.cut(0.0, half), KINDS, cutoff=CUTOFF),
    }
    even = log.resample(PERIOD).filter(CUTOFF)
    v = np.gradient(even.q, PERIOD, axis=0)
    a = np.gradient(v, PERIOD, axis=0)
    inner = slice(round(half / PERIOD), -500)  # the second half, without the end of the filter
    q, v, a, tau = (np.asarray(x)[inner] for x in (even.q, v, a, even.tau))
    models = {"published": published(options.folder, q, v, a)}
    models |= {f"armlet, {name}": fit.model.inverse_dynamics(q, v, a, friction=True) + fit.offsets for name, fit in fits.items()}
    lines = [f"| residual, N m | {' | '.join(f'joint {i + 1}' for i in range(arm.n))} |", "|---" * (arm.n + 1) + "|"]
    for name, model in models.items():
        residual = np.sqrt(np.mean((tau - model) ** 2, axis=0))
        lines.append(f"| {name} | {' | '.join(f'{x:.3f}' for x in residual)} |")
    size = np.sqrt(np.mean((tau - tau.mean(axis=0)) ** 2, axis=0))
    lines.append(f"| torque without its mean | {' | '.join(f'{x:.2f}' for x in size)} |")
    fit = fits["whole log"]
    refuted = ", ".join(sorted({each.name for each in fit.refuted})) or "nothing"
    head = f"{log.t[-1]:.1f} s, {len(log.t):,} samples, {fit.rank} parameters, filter of {CUTOFF:g} Hz. Refuted: {refuted}."
    reporting.finish("log of a Panda", "\n".join([head, "", *lines]), options.readme)


if __name__ == "__main__":
    main()
