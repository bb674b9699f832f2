"""A sweep of gains
================

The script simulates 10,000 runs of an adaptive controller with random gains and draws the error over the gains.

Run: ``python examples/gain_sweep.py [figure.png]``. ``armlet sweep`` runs a sweep from a file and stores its results.
"""

import sys
import time

import numpy as np

import armlet as al

scenario = al.Scenario.from_dict(
    {
        "arm": {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5},
        "motion": {"kind": "Sinusoid", "offset": [0.0, 0.3], "amplitude": [0.5, 0.8], "frequency": [2.0, 3.0], "phase": [0.0, 0.0]},
        "law": {"kind": "Adaptive", "kp": 40.0, "kd": 20.0, "gamma": 5.0},
        "run": {"q0": [0.1, 0.2], "t_end": 4.0, "dt": 4e-3, "record_every": 5},
    }
)
vary = {"law.gamma": {"log_uniform": [0.1, 30.0]}, "law.kd": {"log_uniform": [2.0, 50.0]}, "arm.A": {"uniform": [1.0, 3.0]}}

start = time.perf_counter()
table = al.sweep(scenario, vary, draws=10_000, seed=1)
error = np.degrees(table["error_rms2"])
print(f"{table.rows} runs of 4 s in {time.perf_counter() - start:.1f} s, {np.sum(table['status'] != al.Status.SUCCESS)} failed")
print(f"rms error of joint 2: {np.nanmin(error):.2f} to {np.nanmax(error):.2f} deg")
best = np.nanargmin(error)
print(f"least at gamma = {table['law.gamma'][best]:.1f}, kd = {table['law.kd'][best]:.1f} N m s/rad")

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    def label(axis, ticks):
        """Set a few ticks of a logarithmic axis, labelled with plain numbers."""
        axis.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
        axis.set_ticks([], minor=True)

    figure = plt.figure(figsize=(9.0, 3.8), layout="constrained")
    field, trade = figure.subplots(1, 2)
    points = field.scatter(table["law.gamma"], table["law.kd"], c=error, s=3, cmap="viridis", norm="log", rasterized=True)
    label(figure.colorbar(points, ax=field, label="rms error of joint 2 (deg)").ax.yaxis, [0.8, 1.0, 1.5, 2.0, 2.5])
    field.set(xscale="log", yscale="log", xlabel="adaptation gain gamma (SI)", ylabel="damping gain kd (N s/m, N m s/rad)")
    field.set_title("Error of 10,000 runs with random gains and masses", loc="left", fontsize=10)
    points = trade.scatter(table["tau_peak2"], error, c=table["law.gamma"], s=3, cmap="cividis", norm="log", rasterized=True)
    label(figure.colorbar(points, ax=trade, label="adaptation gain gamma (SI)").ax.yaxis, [0.1, 0.3, 1.0, 3.0, 10.0, 30.0])
    trade.set(xscale="log", yscale="log", xlabel="peak torque of joint 2 (N m)", ylabel="rms error of joint 2 (deg)")
    trade.set_title("Error against peak torque", loc="left", fontsize=10)
    label(field.xaxis, [0.1, 0.3, 1.0, 3.0, 10.0, 30.0])
    label(field.yaxis, [2.0, 5.0, 10.0, 20.0, 50.0])
    label(trade.xaxis, [20.0, 50.0, 100.0])
    label(trade.yaxis, [0.8, 1.0, 1.5, 2.0, 2.5, 3.0])
    figure.savefig(sys.argv[1], dpi=150)
