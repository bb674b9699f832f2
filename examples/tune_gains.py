"""Tuning of gains
===============

Differential evolution finds gains of a joint controller for payloads that the controller does not know.

A two-joint arm in a horizontal plane is under PD control, with samples every 2 ms, 4 ms delay, noisy speeds and limited torque. The cost is
the largest value, over three payloads, of the settling time plus terms for overshoot and torque.

Run: ``python examples/tune_gains.py [figure.png]``; needs scipy (``pip install '.[tune]'`` in the folder of the
sources).
"""

import sys
import time

import armlet as al

arm = {"kind": "planar_arm", "lengths": [0.5, 0.4], "masses": [3.0, 2.0], "gravity": [0.0, 0.0]}
scenario = al.Scenario.from_dict(
    {
        "arm": arm,
        "law": {"kind": "PDGravity", "target": [0.8, 1.2], "kp": [60.0, 30.0], "kd": [5.0, 2.0]},
        "run": {
            "q0": [0.0, 0.0],
            "t_end": 2.0,
            "dt": 2e-3,
            "tau_max": [60.0, 30.0],
            "sample_time": {"period": 2e-3, "delay": 4e-3, "noise": {"v": 0.01}, "seed": 5},
        },
    }
)
masses = [1.0, 2.0, 4.0]  # kg, of the second link
gains = {f"law.{name}[{i}]": {"log_uniform": scale} for name, scale in (("kp", [10.0, 1000.0]), ("kd", [1.0, 200.0])) for i in range(2)}


def cost(table):
    """Settling time, s, plus 1 s per 20 % of overshoot, plus 1 s per 100 N m of rms torque. The torque term penalises noise."""
    return table["settling_time"] + 5.0 * (table["overshoot1"] + table["overshoot2"]) + 0.01 * (table["tau_rms1"] + table["tau_rms2"])


start = time.perf_counter()
options = {"candidates": 40, "generations": 15, "band": 0.02}  # rad
found = al.tune(scenario, gains, cost, over={"arm.masses[1]": masses}, **options)
print(f"{found.runs} runs of 2 s in {time.perf_counter() - start:.1f} s")
print(found)
settled = [found.scenario.replace({"arm.masses[1]": mass}).run().metrics(band=0.02) for mass in masses]
for mass, numbers in zip(masses, settled, strict=True):
    beyond = 100.0 * numbers["overshoot"].max()
    print(f"{mass:.0f} kg: settles in {float(numbers['settling_time']):.2f} s, overshoot {beyond:.1f} %")
assert max(float(numbers["settling_time"]) for numbers in settled) < 0.8

if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(11.0, 3.6), layout="constrained")
    before, after, search = figure.subplots(1, 3)
    for axes, which, title in ((before, scenario, "Before"), (after, found.scenario, "Tuned")):
        for mass, style in zip(masses, (":", "--", "-"), strict=True):
            run = which.replace({"arm.masses[1]": mass}).run()
            for i, colour in enumerate(("#0072B2", "#D55E00")):
                axes.plot(run.t, run.q[:, i], style, color=colour, label=f"joint {i + 1}, {mass:.0f} kg")
        for target in (0.8, 1.2):
            axes.axhspan(target - 0.02, target + 0.02, color="0.85", zorder=0)
        axes.set(xlabel="time (s)", ylabel="angle (rad)", ylim=(-0.4, 2.4))
        axes.set_title(f"{title} (grey: band of 0.02 rad)", loc="left", fontsize=10)
    before.legend(fontsize=7, ncols=2)
    tried = found.tried
    good = tried["cost"] < 10.0
    points = search.scatter(tried["law.kp[0]"][good], tried["law.kd[0]"][good], c=tried["cost"][good], s=6, cmap="viridis_r", vmax=3.0)
    search.plot(tried["law.kp[0]"][~good], tried["law.kd[0]"][~good], "x", color="0.7", markersize=3, zorder=0, label="no settling")
    search.plot(found.best["law.kp[0]"], found.best["law.kd[0]"], "*", color="#D55E00", markersize=14, label="best candidate")
    figure.colorbar(points, ax=search, label="largest cost of three payloads (s)", extend="max")
    search.set(xscale="log", yscale="log", xlabel="kp of joint 1 (N m/rad)", ylabel="kd of joint 1 (N m s/rad)")
    search.set_title(f"Search: {tried.rows} candidates", loc="left", fontsize=10)
    search.legend(fontsize=7)
    figure.savefig(sys.argv[1], dpi=150)
