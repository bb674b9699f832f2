"""The matplotlib figure of all plots: who creates it, its size, and the style, which is reset afterwards."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import models
import numpy as np
import pytest
from boxes import faults
from matplotlib.figure import Figure

import armlet as al
from armlet.demo import demonstrate
from armlet.figures import style
from armlet.figures.minimum_time import MinimumTime
from armlet.figures.time_path import PathTiming

ARM = models.TWO_LINKS


def run() -> al.Run:
    return al.simulate(al.RigidArm(ARM), al.PDGravity(ARM, [0.1, 0.2], 20.0, 5.0), [0.0, 0.0], t_end=0.1, dt=1e-3)


def fitted() -> Any:
    t = np.arange(0.0, 3.0, 0.01)
    q, v, a = al.Sinusoid([0.0, 0.0], [1.0, 1.2], [5.0, 7.0], [0.0, 1.0])(t)
    return al.fit_log(ARM, al.Log(t, q, tau=ARM.inverse_dynamics(q, v, a), names=ARM.joint_names), ["inertia"])


def table() -> Any:
    loop = {"arm": {"kind": "example", "name": "planar_2r"}, "law": {"kind": "PDGravity", "target": [0.1, 0.2], "kp": 20.0, "kd": 5.0}}
    scenario = al.Scenario.from_dict(loop | {"run": {"q0": [0.0, 0.0], "t_end": 0.1, "dt": 1e-3}})
    return al.sweep(scenario, {"law.kp": [10.0, 20.0], "law.kd": [3.0, 4.0]})


def sensitivity() -> Any:
    law = al.PDGravity(ARM, [0.1, 0.2], 20.0, 5.0)
    made = al.simulate(al.RigidArm(ARM), law, [0.0, 0.0], t_end=0.1, dt=1e-3, sensitivity=["law.kp"]).sensitivity
    assert made is not None
    return made["law.kp"]


DRAWN: dict[str, tuple[str, Callable[..., Any]]] = {
    "arm": ("Arm.show", lambda fig: ARM.show([0.3, 0.9], fig=fig)),
    "arm in space": ("Arm.show", lambda fig: ARM.show([0.3, 0.9], view=[20.0, 30.0], fig=fig)),
    "run": ("Run.plot", lambda fig: run().plot(fig)),
    "compare": ("compare", lambda fig: al.compare([run()], fig=fig)),
    "log": ("Log.plot", lambda fig: al.read_log(run()).plot(fig)),
    "fit": ("LogFit.plot", lambda fig: fitted().plot(fig)),
    "mintime": ("MinimumTime.plot", lambda fig: MinimumTime(0.0, 1.0, 1.0, 0.5, 1.0).plot(fig)),
    "path": ("PathTiming.plot", lambda fig: PathTiming(ARM, al.time_path(ARM, [[0.0, 0.0], [1.0, 0.5]], tau_max=20.0), 20.0).plot(fig)),
    "program": (
        "LoopProgram.plot",
        lambda fig: al.loop_program(al.RigidArm(ARM), al.PDGravity(ARM, [0.1, 0.2], 20.0, 5.0), method="euler").plot(fig),
    ),
    "sensitivity": ("Sensitivity.plot", lambda fig: sensitivity().plot(fig)),
    "sweep": ("SweepTable.plot", lambda fig: table().plot(fig=fig)),
}


@pytest.mark.parametrize("name", DRAWN)
def test_drawn_into_what_is_given(name: str) -> None:
    figure, before = Figure(figsize=(3.0, 2.0)), {key: matplotlib.rcParams[key] for key in style.STYLE}
    DRAWN[name][1](figure)
    assert figure.axes and {key: matplotlib.rcParams[key] for key in before} == before
    # Figures with several panels set their size. The figure of a sweep keeps the size of the caller.
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
    """The plot of a Cartesian law includes the distance of the frame from its target."""
    law = al.CartesianImpedance(ARM, [0.5, 0.5], 300.0, 40.0, frame="link2", axes="xy")
    made = al.simulate(al.RigidArm(ARM), law, [0.3, 1.0], t_end=0.1, dt=1e-3)
    (panel,) = [ax for ax in made.plot(Figure()).flat if ax.get_ylabel() == "distance (m)"]
    assert made.position_error is not None
    assert (panel.get_lines()[0].get_ydata() == made.position_error[:, 0]).all() and panel.get_ylim()[0] == 0.0
    assert not [ax for ax in run().plot(Figure()).flat if ax.get_ylabel() == "distance (m)"]


def test_the_rotation_of_a_law_with_orientation_rows() -> None:
    law = al.CartesianImpedance(ARM, [0.5, 0.5, 0.9], 300.0, 40.0, frame="link2", axes="xy rz")
    made = al.simulate(al.RigidArm(ARM), law, [0.3, 1.0], t_end=0.1, method="dop853")
    (panel,) = [ax for ax in made.plot(Figure()).flat if ax.get_ylabel() == "angle (rad)"]
    np.testing.assert_allclose(panel.get_lines()[0].get_ydata(), np.abs(0.9 - made.q.sum(axis=1)), rtol=0.0, atol=1e-14)


@pytest.mark.parametrize(
    ("metric", "label"),
    [
        ("tau_peak2", "tau_peak2 (N m or N)"),
        ("error_rms1", "error_rms1 (rad or m)"),
        ("settling_time", "settling_time (s)"),
        ("overshoot1", "overshoot1"),
    ],
)
def test_a_sweep_by_a_chosen_metric(metric: str, label: str) -> None:
    figure, drawn = Figure(), table()
    ax = drawn.plot(metric, figure)
    assert [other.get_ylabel() for other in figure.axes if other is not ax] == [label]
    np.testing.assert_array_equal(ax.collections[0].get_array(), drawn[metric][np.isfinite(drawn[metric])])


def test_the_force_of_a_wall() -> None:
    """At rest the wall's force balances the law's stiffness. The frame is between the surface of the wall and the target of the law."""
    wall = al.Wall("link2", [0.7, 0.0, 0.0], [-2.0, 0.0, 0.0], stiffness=1e3, damping=20.0)
    law = al.CartesianImpedance(ARM, [0.75, 0.2], 300.0, 40.0, frame="link2", axes="xy")
    made = al.simulate(al.RigidArm(ARM, wall=wall), law, [0.8, 1.2], t_end=3.0, dt=1e-3)
    force = made.contact_force
    # Two springs in series with 0.05 m between their rest positions. The tolerance covers the motion that remains after 3 s.
    assert force is not None and force.min() == 0.0 and force[-1] == pytest.approx(0.05 / (1 / 300.0 + 1 / 1e3), rel=1e-3)
    (panel,) = [ax for ax in made.plot(Figure()).flat if ax.get_ylabel() == "force (N)"]
    np.testing.assert_array_equal(panel.get_lines()[0].get_ydata(), force)
    assert run().contact_force is None and not [ax for ax in run().plot(Figure()).flat if ax.get_ylabel() == "force (N)"]


def test_estimates_of_many_links() -> None:
    """Each kind of parameter has a panel with its unit. Links differ by colour, components by line style."""
    law = al.Adaptive(ARM, al.Sinusoid([0.1, 0.2], [0.3, 0.3], [1.0, 2.0], [0.0, 0.0]), 50.0, 5.0, 1.0, friction=True)
    axes = al.simulate(al.RigidArm(ARM), law, [0.0, 0.0], t_end=0.1, dt=1e-3).plot(Figure())
    panels = [ax for ax in axes.flat if "Estimates" in ax.get_title(loc="left")]
    assert [len(panel.get_lines()) for panel in panels] == [2, 6, 6, 6, 4]
    assert [line.get_linestyle() for line in panels[1].get_lines()] == ["-", "--", ":"] * 2
    assert [panel.get_ylabel() for panel in panels[:2]] == ["masses (kg)", "first moments (kg m)"]
    assert all(len({line.get_color() for line in panel.get_lines()}) == 2 for panel in panels)


def test_estimates_of_an_arm_with_a_mimic_joint() -> None:
    """Six bodies and five coordinates: the 60 estimates are all inertial parameters, not those of five bodies and ten friction terms."""
    body = {"type": "R", "axis": [0, 0, 1], "xyz": [0.3, 0, 0], "phi": [1, 0.1, 0, 0, 0.02, 0, 0.02, 0, 0, 0.04]}
    arm = al.Arm.from_chain([dict(body) for _ in range(5)] + [{**body, "mimic": {"joint": 0}}])
    law = al.Adaptive(arm, al.Hold([0.1] * 5), 20.0, 5.0, 0.1)
    axes = al.simulate(al.RigidArm(arm), law, [0.0] * 5, t_end=0.01, dt=1e-3).plot(Figure())
    panels = [ax for ax in axes.flat if "Estimates" in ax.get_title(loc="left")]
    assert [len(panel.get_lines()) for panel in panels] == [6, 18, 18, 18]


def test_joints_are_named_once() -> None:
    """Joints and dashes are explained below the panels. No panel has a legend over its data."""
    law = al.ComputedTorque(ARM, al.Quintic([0.0, 0.0], [0.5, 0.5], 1.0), 50.0, 10.0)
    figure = Figure()
    axes = al.simulate(al.RigidArm(ARM), law, [0.0, 0.0], t_end=0.1, dt=1e-3).plot(figure)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["joint1", "joint2", "desired"]
    assert not [ax for ax in axes.flat if ax.get_legend()]


def test_limits_that_a_run_comes_near() -> None:
    joints = [{"type": "R", "axis": [0, 0, 1], "phi": [1, 0, 0, 0, 1, 0, 1, 0, 0, 1], "effort": 10.0, "upper": 0.5, "lower": -40.0}] * 2
    arm = al.Arm.from_chain(joints)
    figure = Figure()
    law = al.PDGravity(arm, [0.4, 0.1], 20.0, 5.0)
    run = al.simulate(al.RigidArm(arm), law, [0.0, 0.0], t_end=3.0, dt=1e-3)
    axes = run.plot(figure)
    drawn = {ax.get_title(loc="left"): [line.get_ydata()[0] for line in ax.get_lines() if line.get_gid() == "limit"] for ax in axes.flat}
    assert drawn["Joint positions"] == [0.5, 0.5] and drawn["Joint torques"] == [10.0, 10.0]
    assert run.q[:, 0].max() > 0.5
    assert [text.get_text() for text in figure.legends[0].get_texts()[-2:]] == ["limit", "beyond limit"]


def test_many_joints_share_no_panel() -> None:
    """A panel has at most seven joints, with their names."""
    arm = al.planar_arm([0.1] * 9)
    axes = al.simulate(al.RigidArm(arm), al.PDGravity(arm, [0.1] * 9, 1.0, 0.1), [0.0] * 9, t_end=1e-3, method="dop853").plot(Figure())
    titles = [ax.get_title(loc="left") for ax in axes.flat]
    assert titles[:2] == ["Joint positions, 1 to 5", "Joint positions, 6 to 9"] and "Joint torques, 6 to 9" in titles
    assert [text.get_text() for text in axes[0, 1].get_legend().get_texts()] == [f"joint{i}" for i in range(6, 10)]


@pytest.mark.parametrize("name", DRAWN)
def test_without_matplotlib_nothing_is_drawn(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    caller, draw = DRAWN[name]
    with pytest.raises(ImportError) as fault:
        draw(None)
    assert str(fault.value) == f"{caller}: matplotlib is not installed: pip install '.[plot]' in the folder of armlet's sources"
    assert not style.available()


@pytest.mark.slow
def test_no_text_of_the_demonstration_is_cut_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Titles and axis labels are within their figures. No texts overlap, and every axis has a unit."""
    drawn: list[str] = []
    cut: list[str] = []
    wrong: list[str] = []
    save = Figure.savefig

    def savefig(figure: Figure, file: Any, **options: Any) -> None:
        save(figure, file, **options)
        wrong.extend(faults(figure))
        for ax in figure.axes:
            texts = [ax.title, ax._left_title, ax._right_title, ax.xaxis.label, ax.yaxis.label]
            for text in (text for text in texts if text.get_text()):
                box = text.get_window_extent()
                inside = box.x0 >= figure.bbox.x0 and box.x1 <= figure.bbox.x1 and box.y0 >= figure.bbox.y0 and box.y1 <= figure.bbox.y1
                (drawn if inside else cut).append(text.get_text())

    monkeypatch.setattr(Figure, "savefig", savefig)
    demonstrate(tmp_path)
    assert not cut, cut
    assert not wrong, wrong
    assert len(drawn) > 40
