"""Pages that run the loops of the theory pages in the browser, and the links to them.

`python docs/live_loops.py FOLDER` writes the pages. As an extension of Sphinx, this file adds a link to each page of `LOOPS`, at the end of
its example. A reader on a code host sees no link, because the repository has no such pages.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

Loop = tuple[Any, Any, dict[str, Any], dict[str, tuple[float, float]], str]


def _adaptive() -> Loop:
    arm = al.planar_pr(A=2.0, B=0.5, C=0.5)
    motion = al.Sinusoid(offset=[0.0, 0.3], amplitude=[0.5, 0.8], frequency=[3.0, 2.0], phase=[0.0, 0.0])
    law = al.Adaptive(arm, motion, kp=[40.0, 20.0], kd=[20.0, 10.0], gamma=5.0)
    controls = {"law.gamma": (0.5, 50.0), "law.kd[0]": (5.0, 60.0), "law.kd[1]": (2.0, 30.0), "arm.parameters[0]": (1.0, 5.0)}
    return al.RigidArm(arm), law, {"q0": [0.2, -0.3]}, controls, "Change the gains or the mass A, and see the Lyapunov function"


def _impedance() -> Loop:
    arm = al.load_urdf(al.example_urdf("seven_axis"))
    q0 = np.array([0.2, 0.6, 0.1, -1.3, 0.2, 0.9, 0.3])
    better = al.NullSpace(np.add(q0, [0.5, -0.2, -0.6, 0.2, 0.3, 0.2, -0.4]), stiffness=30.0, damping=12.0)
    law = al.CartesianImpedance(arm, arm.position(q0, "tcp"), 400.0, 40.0, frame="tcp", axes="xyz", nullspace=better)
    controls = {"law.stiffness": (50.0, 1000.0), "law.damping": (10.0, 150.0)}
    return al.RigidArm(arm), law, {"q0": q0}, controls, "Change the stiffness, and drag the target of the tip"


def _elastic() -> Loop:
    arm = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0])
    springs, motors = np.array([800.0, 500.0]), np.array([0.4, 0.25])
    target = arm.position([0.3, 1.2], "link2")[:2]
    law = al.ElasticImpedance(arm, target, [300.0, 200.0], [40.0, 30.0], springs, motors, motors / 20, frame="link2", axes="xy")
    controls = {"law.stiffness[0]": (50.0, 600.0), "law.stiffness[1]": (50.0, 600.0)}
    return al.ElasticArm(arm, springs, motors), law, {"q0": [0.3, 1.2], "dt": 5e-4}, controls, "Drag the target, and change its stiffness"


#: For each page: its loop, and the text of the link.
LOOPS: dict[str, Callable[[], Loop]] = {"adaptive": _adaptive, "impedance": _impedance, "elastic": _elastic}


def write(folder: Path) -> None:
    """Write the page of each loop."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in LOOPS.items():
        plant, law, options, controls, _ = make()
        al.export_web((plant, law), folder / f"{name}.html", controls, **options)


def linked(name: str, page: str) -> str:
    """Return the text of a page with a link to its loop before its second heading."""
    first = page.find("\n## ")
    at = page.find("\n## ", first + 1)
    link = f'\n<p><a href="loops/{name}.html">Run this loop in the browser.</a> {LOOPS[name]()[-1]}.</p>\n'
    return page[:at] + link + page[at:]


def setup(app: Any) -> dict[str, Any]:
    def add_link(_: Any, name: str, source: list[str]) -> None:
        if name in LOOPS:
            source[0] = linked(name, source[0])

    app.connect("source-read", add_link)
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    write(Path(sys.argv[1]))
