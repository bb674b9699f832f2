"""The figure of a run: its title, the names of joints and parameters, one unit per axis, and limits that are not drawn."""

from __future__ import annotations

import models
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from test_figures import DRAWN

import armlet as al
from armlet.cli import main
from armlet.figures.style import COLOURS
from armlet.figures.time_path import PathTiming

PR = models.PR
BODY = {"type": "R", "axis": [0, 0, 1], "xyz": [0.3, 0, 0], "phi": [1, 0, 0, 0, 1, 0, 1, 0, 0, 1]}


def plotted(arm: al.Arm, law: object, **given: object) -> tuple[Figure, list[Axes]]:
    figure = Figure()
    axes = al.simulate(al.RigidArm(arm), law, [0.0] * arm.n, t_end=0.1, dt=1e-3, **given).plot(figure)  # type: ignore[arg-type]
    return figure, [ax for ax in axes.flat if ax.get_visible()]


def adaptive(arm: al.Arm) -> al.Adaptive:
    return al.Adaptive(arm, al.Hold([0.1] * arm.n), 20.0, 5.0, 0.1)


def legend_names(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.parametrize("name", ["run", "compare", "mintime", "path"])
def test_no_legend_covers_a_title_of_the_figure(name: str) -> None:
    figure = Figure()
    DRAWN[name][1](figure)
    title = figure.suptitle("A scenario with a title")
    figure.draw_without_rendering()
    (legend,) = figure.legends
    boxes = [legend.get_window_extent(), *(ax.get_tightbbox() for ax in figure.axes if ax.get_visible())]
    assert not any(title.get_window_extent().overlaps(box) for box in boxes)
    assert not any(boxes[0].overlaps(box) for box in boxes[1:])


def test_the_title_of_a_scenario_is_visible(tmp_path: object, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    def savefig(figure: Figure, file: object, **_: object) -> None:
        figure.draw_without_rendering()
        title = figure._suptitle  # type: ignore[attr-defined]
        seen.append((title.get_text(), title.get_window_extent().overlaps(figure.legends[0].get_window_extent())))

    monkeypatch.setattr(Figure, "savefig", savefig)
    monkeypatch.chdir(tmp_path)  # type: ignore[arg-type]
    scenario = """title = "Reach"
arm = { kind = "example", name = "planar_2r" }
law = { kind = "PDGravity", target = [0.1, 0.2], kp = 20.0, kd = 5.0 }
run = { q0 = [0.0, 0.0], t_end = 0.1, dt = 1e-3 }
"""
    with open("reach.toml", "w") as file:
        file.write(scenario)
    assert main(["run", "reach.toml", "--plot"]) == 0
    assert seen == [("Reach", False)]


@pytest.mark.parametrize(
    ("names", "labels"),
    [
        (["joint_1", "joint_2"], ["joint_1", "joint_2"]),
        (["shoulder", "elbow"], ["1 shoulder", "2 elbow"]),
        (["shoulder", "wrist_1"], ["1 shoulder", "2 wrist_1"]),
    ],
)
def test_a_joint_has_one_number(names: list[str], labels: list[str]) -> None:
    arm = al.Arm.from_chain([BODY | {"name": name} for name in names])
    figure, _ = plotted(arm, al.PDGravity(arm, [0.1, 0.2], 20.0, 5.0))
    assert legend_names(figure) == labels


def test_long_names_of_joints_are_within_the_figure() -> None:
    arm = al.Arm.from_chain([BODY | {"name": f"left_manipulator_joint_number_{i}"} for i in range(7)])
    figure, _ = plotted(arm, al.PDGravity(arm, [0.1] * 7, 20.0, 5.0))
    figure.draw_without_rendering()
    box = figure.legends[0].get_window_extent()
    assert box.x0 >= 0.0 and box.x1 <= figure.bbox.x1 and len(legend_names(figure)) == 7
    assert legend_names(figure)[0] == "left_manipulator_joint_number_0"


def test_estimates_have_the_names_of_the_parameters() -> None:
    _, axes = plotted(PR, adaptive(PR))
    (panel,) = [ax for ax in axes if ax.get_title(loc="left") == "Parameter estimates"]
    legend = panel.get_legend()
    assert legend is not None and [text.get_text() for text in legend.get_texts()] == ["A", "B", "C", "true"]
    one = al.Arm.from_chain([BODY])
    _, axes = plotted(one, al.Adaptive(one, al.Hold([0.1]), 20.0, 5.0, 0.1, friction=True))
    (legend,) = [ax.get_legend() for ax in axes if ax.get_legend()]
    assert legend is not None and [text.get_text() for text in legend.get_texts()][:2] == ["m[joint1]", "mcx[joint1]"]


@pytest.mark.parametrize("law", ["Adaptive", "PID", "PDGravity"])
def test_an_axis_has_one_unit(law: str) -> None:
    """Lengths and angles, and forces and torques, have different panels. Joint 1 moves in m, joint 2 in rad."""
    made = {"Adaptive": adaptive(PR), "PID": al.PID(PR, [0.1, 0.2], 20.0, 10.0, 5.0), "PDGravity": al.PDGravity(PR, [0.1, 0.2], 20.0, 5.0)}[
        law
    ]
    _, axes = plotted(PR, made)
    labels = [ax.get_ylabel() for ax in axes]
    assert [label for label in labels if "," in label] == []
    assert {"position (m)", "position (rad)", "input (N)", "input (N m)"} <= set(labels)
    colours = {ax.get_ylabel(): [line.get_color() for line in ax.get_lines()] for ax in axes}
    assert colours["input (N)"] == colours["position (m)"][:1] != colours["input (N m)"]


def test_units_of_joints_in_any_order() -> None:
    joints = [BODY | {"type": kind} for kind in "PRPRPRPRP"]
    arm = al.Arm.from_chain(joints)
    _, axes = plotted(arm, al.PDGravity(arm, [0.01] * 9, 20.0, 5.0))
    titles = {ax.get_title(loc="left"): ax.get_ylabel() for ax in axes}
    assert titles["Joint positions, 1, 3, 5, 7, 9"] == "position (m)" and titles["Joint positions, 2, 4, 6, 8"] == "position (rad)"


def test_positions_of_a_path_have_one_unit_per_axis() -> None:
    arm = al.Arm.from_chain([BODY | {"type": "P"}, BODY])
    figure = Figure()
    PathTiming(arm, al.time_path(arm, [[0.0, 0.0], [1.0, 0.5]], tau_max=20.0), 20.0).plot(figure)
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert {"joint position (m)", "joint position (rad)", "joint speed (m/s)", "joint speed (rad/s)"} <= set(labels)
    lines = {ax.get_ylabel(): [line.get_color() for line in ax.get_lines()] for ax in figure.axes}
    assert lines["joint position (m)"] != lines["joint position (rad)"]


def test_limits_that_are_not_drawn_are_named() -> None:
    """The note names the nearest of the limits without a line. An infinite limit is none."""
    joints = [BODY | {"effort": 10.0, "upper": 0.5, "lower": -40.0}, BODY | {"effort": 10.0, "upper": 60.0, "lower": -50.0}]
    arm = al.Arm.from_chain(joints)
    law = al.PDGravity(arm, [0.4, 0.1], 20.0, 5.0)
    axes = al.simulate(al.RigidArm(arm), law, [0.0, 0.0], t_end=3.0, dt=1e-3).plot(Figure())
    notes = {ax.get_title(loc="left"): ax.get_title(loc="right").replace("\N{MINUS SIGN}", "-") for ax in axes.flat}
    assert notes["Joint positions"] == "limits not drawn: \N{LESS-THAN OR EQUAL TO} -40, \N{GREATER-THAN OR EQUAL TO} 60"
    assert notes["Joint torques"] == "limits not drawn: \N{LESS-THAN OR EQUAL TO} -10"
    assert notes["Joint velocities"] == ""


def test_a_note_on_limits_covers_no_title() -> None:
    six = models.SIX_AXES
    figure, axes = plotted(six, al.ComputedTorque(six, al.Quintic([0.0] * 6, [0.5] * 6, 2.0), 400.0, 40.0))
    figure.draw_without_rendering()
    noted = [ax for ax in axes if ax.get_title(loc="right")]
    assert noted and not any(ax._left_title.get_window_extent().overlaps(ax._right_title.get_window_extent()) for ax in noted)  # type: ignore[attr-defined]


def test_levels_of_priority_have_one_unit_per_axis() -> None:
    """Levels in m and in rad have different panels. A level keeps its colour, and a level with both units has a panel that says so."""
    arm = models.SEVEN_AXES
    q = [0.2, 0.6, 0.1, -1.3, 0.2, 0.9, 0.3]
    here = arm.pose_vector(q, "tcp")
    tasks = [al.Task("tcp", "xyz", here[:3] + 0.01, 2.0), al.PostureTask(q, 1.0), al.Task("tcp", "z rz", [here[2], here[5]], 2.0)]
    law = al.PriorityVelocity(arm, tasks)
    axes = al.simulate(al.VelocityArm(arm), law, q, t_end=0.1, dt=1e-3).plot(Figure())
    shown = [ax for ax in axes.flat if ax.get_visible() and "levels" in ax.get_title(loc="left")]
    assert [ax.get_ylabel() for ax in shown] == [
        *("error (m)", "error (rad)", "error (m or rad)"),
        *("residual (m/s)", "residual (rad/s)", "residual (m/s or rad/s)"),
    ]
    assert len({ax.get_lines()[0].get_color() for ax in shown[:3]}) == 3


def held(limits: dict[str, object], t_end: float) -> al.Run:
    """A run of the seven axes to a target that is too far for the limits, with a posture on level 2."""
    arm, q = models.SEVEN_AXES, [0.3, -0.5, 0.2, -1.5, 0.1, 1.2, 0.4]
    tasks = [al.Task("tcp", "xyz", [2.0, 0.5, 0.3], 5.0), al.PostureTask([0.0] * 7, 1.0)]
    law = al.PriorityVelocity(arm, tasks, **limits)  # type: ignore[arg-type]
    return al.simulate(al.VelocityArm(arm), law, q, t_end=t_end, dt=0.01, sample_time=0.01)


def bands(run: al.Run) -> tuple[str, dict[tuple[str, str], list[tuple[float, float]]]] | None:
    """The title of the panel of active bounds, and its bands: start and end by the name of the bound and by colour."""
    found = [ax for ax in run.plot(Figure()).flat if ax.get_title(loc="left").startswith("Bounds")]
    if not found:
        return None
    (ax,) = found
    names = [label.get_text() for label in ax.get_yticklabels()]
    drawn: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for collection in ax.collections:
        for path in collection.get_paths():
            (start, low), (end, high) = path.vertices.min(axis=0), path.vertices.max(axis=0)
            colour = to_hex(collection.get_facecolor()[0]).upper()
            drawn.setdefault((names[round(0.5 * (low + high))], colour), []).append((start, end))
    return ax.get_title(loc="left"), drawn


def test_a_bound_that_holds_a_level_has_a_band() -> None:
    run = held({"v_max": [2.0, 0.5, 2.0, 2.0, 2.0, 2.0, 2.0]}, 0.4)
    assert run.active and {hold.level for hold in run.active} == {1, 2}
    expected: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for hold in run.active:
        expected.setdefault((f"{hold.name}, {hold.side}", COLOURS[hold.level - 1]), []).append((hold.start, hold.end))
    assert bands(run) == ("Bounds that hold a level", expected)


def test_bounds_without_a_band(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run whose limits hold no level has no such panel. If there are many bounds, those that hold for the longest time have bands."""
    monkeypatch.setattr("armlet.figures.levels.BANDS", 4)
    assert bands(held({"v_max": 1e3, "limits": False}, 0.1)) is None
    run = held({"limits": True}, 1.0)
    assert run.active
    times: dict[str, float] = {}
    for hold in run.active:
        name = f"{hold.name}, {hold.side}"
        times[name] = times.get(name, 0.0) + hold.end - hold.start
    assert len(times) > 4
    made = bands(run)
    assert made is not None and made[0] == f"Bounds that hold a level, the longest 4 of {len(times)}"
    assert sorted(times[name] for name in {name for name, _ in made[1]}) == sorted(times.values())[-4:]


def test_an_integral_wrench_has_one_unit_per_axis() -> None:
    arm = models.SEVEN_AXES
    q = [0.2, 0.6, 0.1, -1.3, 0.2, 0.9, 0.3]
    law = al.CartesianImpedance(arm, arm.pose_vector(q, "tcp")[[0, 4]], 400.0, 40.0, frame="tcp", axes="x ry", integral_gain=100.0)
    axes = al.simulate(al.RigidArm(arm), law, q, t_end=0.01, dt=1e-3).plot(Figure())
    panels = {ax.get_title(loc="left"): ax.get_ylabel() for ax in axes.flat if "Integral" in ax.get_title(loc="left")}
    assert panels == {"Integral forces": "integral wrench (N)", "Integral torques": "integral wrench (N m)"}


def test_positions_and_torques_beyond_limits_are_marked() -> None:
    """The arm passes a joint limit and its torque limit, but no speed limit. A lower limit above zero counts, too."""
    arm = al.Arm.from_chain([{**BODY, "lower": 0.05, "upper": 0.4, "velocity": 50.0, "effort": 3.0}])
    figure, axes = plotted(arm, al.PDGravity(arm, [0.5], 200.0, 5.0), check_limits=False)
    marked = {ax.get_title(loc="left"): [line for line in ax.get_lines() if line.get_gid() == "excess"] for ax in axes}
    assert marked["Joint positions"] and marked["Joint torques"] and not marked["Joint velocities"]
    assert "beyond limit" in legend_names(figure)


@pytest.mark.parametrize("given", ["run", "law"])
def test_limits_of_the_input_are_drawn(given: str) -> None:
    """The torques of a run end at the limits of the run or of its law, which the arm does not have."""
    arm = models.TWO_LINKS
    law = al.PID(arm, [1.0, 0.5], 80.0, None, 8.0, tau_max=[5.0, 3.0] if given == "law" else None)
    _, axes = plotted(arm, law, **({"tau_max": [5.0, 3.0]} if given == "run" else {}))
    (torques,) = (ax for ax in axes if ax.get_title(loc="left") == "Joint torques")
    drawn = [line for line in torques.get_lines() if line.get_gid() == "limit"]
    note = torques.get_title(loc="right")
    assert {abs(float(line.get_ydata()[0])) for line in drawn} <= {5.0, 3.0}  # type: ignore[index]
    assert len(drawn) == 4 or "limits not drawn" in note
