"""The moving picture of `README.md`."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from registry import drawing
from sketch import BLUE, GREY, INK, RED

import armlet as al
from armlet.figures.style import sheet


@drawing("readme.svg", "An arm that follows two tasks in both orders of priority, and the error of its tip", "")
def orders(figure: Figure) -> None:
    arm, start = al.planar_arm([1.0, 1.0, 0.25, 0.25]), [0.4, 1.2, 0.6, -1.2]
    goal, place = [0.2, 1.0], arm.position(start, "link2")[:2]
    tip = al.Task("link4", "xy", al.Quintic(arm.position(start, "link4")[:2], goal, 2.0), 10.0)
    elbow = al.Task("link2", "xy", place, 10.0)
    motions = []
    with sheet(figure, (7.2, 2.7)) as made:
        scene, errors = made.subplots(1, 2)
        for order, name, colour, style in (([tip, elbow], "tip first", BLUE, "-"), ([elbow, tip], "elbow first", RED, "--")):
            run = al.simulate(al.VelocityArm(arm), al.PriorityVelocity(arm, order), start, t_end=3.0, dt=5e-3)
            joints = np.stack([arm.position(run.q[::10], f"link{i}")[:, :2] for i in range(1, 5)], axis=1)
            joints = np.concatenate([np.zeros_like(joints[:, :1]), joints], axis=1)
            gid = name.replace(" ", "-")
            scene.plot(*joints[-1].T, style, color=colour, linewidth=4.0, alpha=0.75, label=name, gid=gid)
            errors.plot(run.t, run.monitors[f"error_{order.index(tip) + 1}"], style, color=colour)
            motions.append((gid, scene, joints))
        times = run.t[::10]
        errors.plot([3.0, 3.0], [-0.02, 0.35], color=GREY, linewidth=1.0, gid="now")
        motions.append(("now", errors, np.stack([np.stack([times, 0.0 * times + y], axis=1) for y in (-0.02, 0.35)], axis=1)))
        scene.plot(*goal, "x", color=INK, markersize=9, markeredgewidth=2.0, label="target of the tip")
        scene.plot(*place, "+", color=GREY, markersize=11, markeredgewidth=2.0, label="target of the elbow")
        scene.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", xlim=(-0.3, 1.6), ylim=(-0.1, 1.95))
        errors.set(xlabel="time (s)", ylabel="error of the tip (m)", xlim=(0.0, 3.05), ylim=(-0.02, 0.35))
        scene.legend(loc="upper right", bbox_to_anchor=(-0.25, 1.0), frameon=False)
    figure.motions = motions  # type: ignore[attr-defined]
