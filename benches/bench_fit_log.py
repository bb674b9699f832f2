"""Computing time of `al.fit_log` for a log of 60 s at 1 kHz of seven joints.

python -P benches/bench_fit_log.py              the table
python -P benches/bench_fit_log.py --readme     the table, written into benches/README.md
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
import reporting
import timing

ROTORS, VISCOUS, NOISE = 0.1, 1.0, 0.2


def recorded(arm: al.Arm) -> al.Log:
    """A log of two sinusoids per joint, with noise of the torques and of the encoders."""
    rng = np.random.default_rng(0)
    t = np.arange(0.0, 60.0, 1e-3)
    shape = (arm.n, 2)
    motion = al.Sinusoid(np.zeros(arm.n), np.full(shape, 0.4), 2.0 * np.pi * rng.uniform(0.1, 0.6, shape), rng.uniform(0.0, 6.0, shape))
    q, v, a = motion(t)
    tau = arm.inverse_dynamics(q, v, a, friction=True) + NOISE * rng.normal(size=q.shape)
    return al.Log(t, q + 1e-5 * rng.normal(size=q.shape), tau=tau, names=arm.joint_names)


def main() -> None:
    options = reporting.arguments("the fit of a log").parse_args()
    reporting.require_release("bench_fit_log")
    share = timing.busy()
    arm = al.load_urdf(al.example_urdf("seven_axis")).with_drives(armature=ROTORS, damping=VISCOUS)
    log = recorded(arm)
    cases = {
        "inverse": (arm, ("inertia", "rotors", "viscous", "coulomb", "offsets"), 2.0),
        "prediction": (al.RigidArm(arm, friction=True), ("rotors", "viscous", "offsets"), 60.0),
    }
    lines = ["| fit | parameters | goal | time | of a processor |", "|---|---:|---:|---:|---:|"]
    for name, (model, kinds, goal) in cases.items():
        start, used = time.perf_counter(), time.process_time()
        fit = al.fit_log(model, log, kinds, held=False)
        seconds, own = time.perf_counter() - start, time.process_time() - used
        friction = fit.arm.limits["damping"]
        # The values are right before their time counts: five of the largest deviations of the viscous friction.
        np.testing.assert_allclose(friction, VISCOUS, atol=0.05)
        lines.append(f"| {name} | {len(fit.names)} | {goal:g} s | {seconds:.1f} s | {own:.1f} s |")
    machine = timing.machine()
    head = f"{machine['cpu']}, {machine['cores']} cores, {machine['simd']}; other programs used {share:.0%} of them. One fit each."
    reporting.finish("fit of a log", "\n".join([head, "", *lines]), options.readme)


if __name__ == "__main__":
    main()
