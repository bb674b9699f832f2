"""Worst case of a loop
====================

A search finds the payload, the start and the mass with the largest tracking error, in a hundredth of the runs of random draws.

A two-joint arm under computed torque carries a payload that its model does not have. The criterion is a bound of 0.25 rad on the error.

Run: ``python examples/worst_case.py [figure.png]``
"""

import sys
import time

import armlet as al

arm = {"kind": "planar_arm", "lengths": [0.5, 0.4], "masses": [3.0, 2.0]}
scenario = al.Scenario(
    {
        "arm": arm | {"payload": {"frame": "link2", "com": [0.4, 0.0, 0.0], "mass": 0.0}},
        "model": arm,
        "motion": {"kind": "Quintic", "q0": [0.0, 0.3], "q1": [0.8, 0.9], "duration": 0.7},
        "law": {"kind": "ComputedTorque", "kp": [400.0, 400.0], "kd": [40.0, 40.0]},
        "run": {"q0": [0.0, 0.3], "t_end": 1.0, "dt": 2e-3, "sample_time": {"period": 2e-3}},
    }
)
box = {
    "arm.payload.mass": {"uniform": [0.0, 0.3]},  # kg
    "arm.masses[1]": {"uniform": [1.5, 2.5]},  # kg
    "run.q0[0]": {"uniform": [-0.02, 0.02]},  # rad
    "run.q0[1]": {"uniform": [0.28, 0.32]},
}
start = time.perf_counter()
worst = al.worst_case(scenario, box, {"error_peak": 0.25}, runs=40)
print(worst)
print(f"{time.perf_counter() - start:.1f} s")

draws = al.sweep(scenario, box, draws=4000)
lowest = 1.0 - max(draws["error_peak1"].max(), draws["error_peak2"].max()) / 0.25
print(f"smallest margin of 4,000 random draws: {lowest:.4f}")
assert worst.margin <= lowest

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt
    import numpy as np

    figure = plt.figure(figsize=(9.6, 3.6), layout="constrained")
    cloud, search = figure.subplots(1, 2)
    errors = np.maximum(draws["error_peak1"], draws["error_peak2"])
    points = cloud.scatter(draws["arm.payload.mass"], draws["arm.masses[1]"], c=1.0 - errors / 0.25, s=3, cmap="viridis")
    tried = worst.tried
    for stage, marker in (("start", "o"), ("gradient", "^"), ("local", "x")):
        chosen = tried["stage"] == stage
        if chosen.any():
            cloud.plot(
                tried["arm.payload.mass"][chosen], tried["arm.masses[1]"][chosen], marker, color="#D55E00", markersize=4, label=stage
            )
    cloud.set(xlabel="payload (kg)", ylabel="mass of link 2 (kg)")
    cloud.set_title("4,000 random draws, and 40 runs of the search", loc="left", fontsize=10)
    cloud.legend(fontsize=7)
    figure.colorbar(points, ax=cloud, label="margin")
    search.plot(np.arange(1, draws.rows + 1), np.minimum.accumulate(1.0 - errors / 0.25), color="0.5", label="random draws")
    search.plot(np.arange(1, tried.rows + 1), np.minimum.accumulate(tried["margin"]), color="#0072B2", label="search")
    search.set(xscale="log", xlabel="runs", ylabel="smallest margin so far")
    search.set_title("Smallest margin over the number of runs", loc="left", fontsize=10)
    search.legend(fontsize=8)
    figure.savefig(sys.argv[1], dpi=150)
