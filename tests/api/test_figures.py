"""The sheet that all figures are drawn on: who makes it, how large it is, and the style that ends with it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import matplotlib
import pytest
from matplotlib.figure import Figure

import armlet as al
from armlet.figures import style
from armlet.figures.minimum_time import MinimumTime
from armlet.figures.time_path import PathTiming

ARM = al.planar_arm([0.5, 0.4])


def run() -> al.Run:
    return al.simulate(al.RigidArm(ARM), al.PDGravity(ARM, [0.1, 0.2], 20.0, 5.0), [0.0, 0.0], t_end=0.1, dt=1e-3)


def table() -> Any:
    loop = {"arm": {"kind": "example", "name": "planar_2r"}, "law": {"kind": "PDGravity", "target": [0.1, 0.2], "kp": 20.0, "kd": 5.0}}
    scenario = al.Scenario.from_dict(loop | {"run": {"q0": [0.0, 0.0], "t_end": 0.1, "dt": 1e-3}})
    return al.sweep(scenario, {"law.kp": [10.0, 20.0], "law.kd": [3.0, 4.0]})


DRAWN: dict[str, tuple[str, Callable[..., Any]]] = {
    "run": ("Run.plot", lambda fig: run().plot(fig)),
    "compare": ("compare", lambda fig: al.compare([run()], fig=fig)),
    "mintime": ("MinimumTime.plot", lambda fig: MinimumTime(0.0, 1.0, 1.0, 0.5, 1.0).plot(fig)),
    "path": ("PathTiming.plot", lambda fig: PathTiming(ARM, al.time_path(ARM, [[0.0, 0.0], [1.0, 0.5]], tau_max=20.0), 20.0).plot(fig)),
    "program": (
        "LoopProgram.plot",
        lambda fig: al.loop_program(al.RigidArm(ARM), al.PDGravity(ARM, [0.1, 0.2], 20.0, 5.0), method="euler").plot(fig),
    ),
    "sweep": ("SweepTable.plot", lambda fig: table().plot(fig=fig)),
}


@pytest.mark.parametrize("name", DRAWN)
def test_drawn_into_what_is_given(name: str) -> None:
    figure, before = Figure(figsize=(3.0, 2.0)), {key: matplotlib.rcParams[key] for key in style.STYLE}
    DRAWN[name][1](figure)
    assert figure.axes and {key: matplotlib.rcParams[key] for key in before} == before
    # Panels need their room; the one of a sweep takes what it is given.
    assert (tuple(figure.get_size_inches()) == (3.0, 2.0)) == (name == "sweep")


@pytest.mark.parametrize("name", DRAWN)
def test_a_new_one_where_none_is_given(name: str) -> None:
    matplotlib.use("agg")
    from matplotlib import pyplot

    before = pyplot.get_fignums()
    DRAWN[name][1](None)
    (number,) = set(pyplot.get_fignums()) - set(before)
    assert pyplot.figure(number).get_size_inches().min() > 2.0 and pyplot.figure(number).get_layout_engine() is not None
    pyplot.close(number)


def test_the_distance_of_a_cartesian_law() -> None:
    """What the law is for is drawn too: how far the frame is from its target."""
    law = al.CartesianImpedance(ARM, [0.5, 0.5], 300.0, 40.0, frame="link2", axes="xy")
    made = al.simulate(al.RigidArm(ARM), law, [0.3, 1.0], t_end=0.1, dt=1e-3)
    (panel,) = [ax for ax in made.plot(Figure()).flat if ax.get_ylabel() == "distance (m)"]
    assert made.position_error is not None
    assert (panel.get_lines()[0].get_ydata() == made.position_error[:, 0]).all() and panel.get_ylim()[0] == 0.0
    assert not [ax for ax in run().plot(Figure()).flat if ax.get_ylabel() == "distance (m)"]


def test_estimates_of_many_links() -> None:
    """A colour per link, named; forty lines of their own would say nothing."""
    law = al.Adaptive(ARM, al.Sinusoid([0.1, 0.2], [0.3, 0.3], [1.0, 2.0], [0.0, 0.0]), 50.0, 5.0, 1.0)
    axes = al.simulate(al.RigidArm(ARM), law, [0.0, 0.0], t_end=0.1, dt=1e-3).plot(Figure())
    (panel,) = [ax for ax in axes.flat if "estimates" in ax.get_title(loc="left")]
    assert len(panel.get_lines()) == 20 and len({line.get_color() for line in panel.get_lines()}) == 2
    assert [text.get_text() for text in panel.get_legend().get_texts()] == ["link 1", "link 2"]


@pytest.mark.parametrize("name", DRAWN)
def test_without_matplotlib_nothing_is_drawn(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    caller, draw = DRAWN[name]
    with pytest.raises(ImportError) as fault:
        draw(None)
    assert str(fault.value) == f"{caller}: matplotlib is not installed: pip install 'armlet[plot]'"
    assert not style.available()
