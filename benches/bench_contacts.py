"""Loops with contacts and stick-slip friction, compared with the same loops without them: time per accepted step.

Each loop is first compared with a run of another method, to 1e-5 rad.

python -P benches/bench_contacts.py              the table
python -P benches/bench_contacts.py --readme     the table, written into benches/README.md
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
import reporting
import timing
from timing import Case

ARMS = {"planar 2R": al.planar_arm([0.5, 0.4]), "six axes": al.load_urdf(al.example_urdf("six_axis"))}
METHODS: dict[str, dict[str, Any]] = {"rk4": {"dt": 1e-3}, "dopri5": {"rtol": 1e-8}, "dop853": {"rtol": 1e-9}, "radau5": {"rtol": 1e-7}}
SPAN, MOST = 4.0, 1.5


def plants(arm: al.Arm) -> Iterator[tuple[str, al.RigidArm, al.Law, Any]]:
    """The plants with their law and start. Each joint moves by 0.3 rad, and the arm meets the wall or the stops halfway."""
    frame = arm.tip_frame
    start = np.resize([0.3, 0.6, -0.4], arm.n)
    target = start + 0.3
    first, last = arm.position(start, frame), arm.position(target, frame)
    along = (last - first) / np.linalg.norm(last - first)
    kp, kd = (k * np.diag(arm.mass_matrix(start)) for k in (400.0, 40.0))
    law = al.PDGravity(arm, target, kp, kd)
    wall = al.Wall(frame, 0.5 * (first + last), -along, stiffness=5e3, damping=50.0)
    stops = al.JointStops(20.0 * kp, kd, lower=start - 2.0, upper=start + 0.15)
    rubbing = arm.with_drives(friction=0.05 * kp)
    yield "free", al.RigidArm(arm), law, start
    yield "wall", al.RigidArm(arm, wall=wall), law, start
    yield "stops", al.RigidArm(arm, stops=stops), law, start
    yield "stick-slip", al.RigidArm(rubbing, friction="stick_slip"), law, start


def run(plant: al.RigidArm, law: al.Law, start: Any, method: str) -> al.Run:
    records = {"t_eval": np.linspace(0.0, SPAN, 5), "check_limits": False, "monitors": False}
    return al.simulate(plant, law, start, t_end=SPAN, method=method, **METHODS[method], **records)


def cases() -> Iterator[tuple[Case, str]]:
    """The cases, and the engine of each case. Equal results of all methods are asserted first."""
    for name, arm in ARMS.items():
        for what, plant, law, start in plants(arm):
            found = {method: run(plant, law, start, method) for method in METHODS}
            for method, one in found.items():
                np.testing.assert_allclose(one.q[-1], found["dop853"].q[-1], rtol=0.0, atol=1e-5, err_msg=f"{name}, {what}, {method}")
                case = Case(name, f"{name}, {what}, {method}", partial(run, plant, law, start, method), one.stats["steps"], "us", 1e6)
                yield case, one.stats["engine"]


def main() -> None:
    options = reporting.arguments("contacts and stick-slip friction").parse_args()
    reporting.require_release("bench_contacts")
    share, made = timing.busy(), list(cases())
    timing.measure([case for case, _ in made], options.rounds, options.core, lambda text: print(text, flush=True))
    by_name = {case.name: case for case, _ in made}
    lines, verdicts = ["| arm | plant | method | engine | us per step | ratio to the free arm |", "|---|---|---|---|---:|---:|"], []
    for case, engine in made:
        arm, what, method = case.name.split(", ")
        ratio = timing.ratio(case, by_name[f"{arm}, free, {method}"])
        lines.append(f"| {arm} | {what} | {method} | {engine} | {case.median:.2f} | {ratio:.2f} |")
        if what != "free":
            verdicts.append((what, ratio))
    table: list[reporting.Verdict] = []
    for what in ("wall", "stops", "stick-slip"):
        ratios = [ratio for name, ratio in verdicts if name == what]
        good = sum(ratio <= MOST for ratio in ratios)
        goal = f"at most {MOST} times the free arm"
        table.append((what, goal, f"{good} of {len(ratios)}; largest {max(ratios):.2f}", good == len(ratios)))
    text = [reporting.heading([case for case, _ in made], share), "", *reporting.target_table(table), "", *lines]
    reporting.finish("contacts", "\n".join(text), options.readme)


if __name__ == "__main__":
    main()
