"""Exciting motions for identification on five arms: accuracy compared with random sines, and computing time of the search.

python -P benches/bench_excitation.py              the table
python -P benches/bench_excitation.py --readme     the table, written into benches/README.md
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
import reporting
import timing

LIMITS: dict[str, Any] = {"q_min": -1.5, "q_max": 1.5, "v_max": 3.0, "a_max": 10.0}
DURATION, HARMONICS, SAMPLES, DRAWS = 10.0, 5, 100, 20
ARMS = {
    "PR": (al.planar_pr(2.0, 0.5, 0.5), LIMITS),
    "planar 2R": (al.planar_arm([0.5, 0.4]), LIMITS),
    "planar 4R": (al.planar_arm([1.0, 1.0, 0.25, 0.25]), LIMITS),
    "six axes": (al.load_urdf(al.example_urdf("six_axis")), {"a_max": 10.0}),
    "seven axes": (al.load_urdf(al.example_urdf("seven_axis")), {"a_max": 10.0}),
}


def deviations(arm: al.Arm, m: al.Sinusoid) -> np.ndarray:
    """Standard deviations (b,) of the base parameters after one period of samples, if the torque noise is 1 N m."""
    q, v, a = (np.array(x) for x in zip(*(m(t) for t in np.arange(SAMPLES) * (DURATION / SAMPLES)), strict=True))
    W = arm.base_parameters().regressor(q, v, v, a).reshape(q.size, -1)
    return np.sqrt(np.diag(np.linalg.inv(W.T @ W)))


def random_sines(arm: al.Arm, limits: dict[str, Any], rng: np.random.Generator, largest: bool) -> al.Sinusoid:
    """One sine per joint with random harmonic and phase. The amplitude is the largest one within the limits, or a random fraction of it."""
    own = {"a_max": np.inf} | arm.limits | limits
    given = {name: np.broadcast_to(own[name], (arm.n,)) for name in ("q_min", "q_max", "v_max", "a_max")}
    w = 2.0 * np.pi / DURATION * rng.integers(1, HARMONICS + 1, arm.n)
    middle = 0.5 * (given["q_min"] + given["q_max"])
    amplitude = np.min([given["q_max"] - middle, given["v_max"] / w, given["a_max"] / w**2], axis=0)
    share = 1.0 if largest else rng.uniform(0.1, 1.0, arm.n)
    return al.Sinusoid(middle, share * amplitude, w, rng.uniform(0.0, 2.0 * np.pi, arm.n))


def mean(x: np.ndarray) -> float:
    return float(np.exp(np.mean(np.log(x))))


def main() -> None:
    options = reporting.arguments("armlet's exciting motions").parse_args()
    reporting.require_release("bench_excitation")
    share = timing.busy()
    lines = ["| arm | base parameters | search | condition | random sines | largest random sines |", "|---|---:|---:|---:|---:|---:|"]
    for name, (arm, limits) in ARMS.items():
        start = time.perf_counter()
        m = al.exciting_motion(arm, DURATION, limits=limits, harmonics=HARMONICS, samples=SAMPLES)
        seconds = time.perf_counter() - start
        own = deviations(arm, m)
        np.testing.assert_allclose(own, m.deviations, rtol=1e-6)
        ratios = []
        for largest in (False, True):
            others = [mean(deviations(arm, random_sines(arm, limits, np.random.default_rng([8, k]), largest))) for k in range(DRAWS)]
            ratios.append(mean(own) / float(np.median(others)))
        lines.append(f"| {name} | {own.size} | {seconds:.1f} s | {m.condition:.1f} | {ratios[0]:.2f} | {ratios[1]:.2f} |")
        print(lines[-1], flush=True)
    machine = timing.machine()
    head = f"{machine['cpu']}, {machine['cores']} cores, {machine['simd']}; other programs used {share:.0%} of them. One search each."
    reporting.finish("excitation", "\n".join([head, "", *lines]), options.readme)


if __name__ == "__main__":
    main()
