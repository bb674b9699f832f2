"""The worst case: compared with random draws, with closed forms and with differences; failed runs, files, and refused arguments."""

from __future__ import annotations

import math
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from worst_boxes import LOOPS, margin_of_draws

import armlet as al
from armlet import cli
from armlet.sweeping.cube_search import Axis, CubeSearch
from armlet.sweeping.margins import Criterion

SCENARIO = al.Scenario(
    {
        "arm": {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5},
        "motion": {"kind": "Hold", "q": [1.0, 0.0]},
        "law": {"kind": "ComputedTorque", "kp": 100.0, "kd": 20.0},
        "run": {"q0": [0.9, 0.0], "t_end": 0.5, "dt": 2e-3},
    }
)
BOX: dict[str, Any] = {"run.q0[0]": {"uniform": [0.9, 1.3]}, "law.kd": {"uniform": [18.0, 22.0]}}
FEW: dict[str, Any] = {"runs": 24}
#: Number of random draws; `make test-worst` has 1,000,000.
DRAWS = int(os.environ.get("ARMLET_RANDOM_DRAWS", "10000"))


@pytest.mark.parametrize("name", LOOPS)
def test_as_bad_as_many_random_draws_in_a_hundredth_of_the_runs(name: str) -> None:
    scenario, box, criterion = LOOPS[name]
    found = al.worst_case(scenario, box, criterion, runs=DRAWS // 100)
    assert found.runs + found.gradients <= DRAWS // 100
    assert found.margin <= margin_of_draws(scenario, box, criterion, DRAWS)


def test_the_margin_is_that_of_the_run_and_of_the_saved_scenario(tmp_path: Path) -> None:
    """The margin is computed again from the metrics of the run, whose noise has the seed that was found."""
    scenario, box, criterion = LOOPS["samples"]
    found = al.worst_case(scenario, box, criterion, runs=40)
    again = found.scenario.run().metrics()["error_peak"]
    assert found.margin == min(1.0 - again / np.array(criterion["error_peak"]))
    assert found.tried["margin"].min() == pytest.approx(found.margin, rel=1e-9)
    assert found.run.q.tobytes() == scenario.replace(found.values).run().q.tobytes()
    found.scenario.save(tmp_path / "worst.toml")
    loaded = al.Scenario.load(tmp_path / "worst.toml")
    assert loaded.data == found.scenario.data and loaded.run().q.tobytes() == found.run.q.tobytes()


def test_every_margin_of_the_table_is_that_of_its_values() -> None:
    """Rows with equal and with consecutive seeds share no noise: each row is the run of its own scenario."""
    scenario, box, criterion = LOOPS["samples"]
    found = al.worst_case(scenario, box, criterion, runs=40)
    for i in range(0, found.runs, 7):
        values = {path: found.tried[path][i].item() for path in box}
        error = scenario.replace(values).run().metrics()["error_peak"]
        assert found.tried["margin"][i] == pytest.approx(min(1.0 - error / np.array(criterion["error_peak"])), rel=1e-9)


def test_a_corner_with_a_closed_form() -> None:
    """The largest force is that of the start, kp A |e|: the farther end of the interval of the start is the worst."""
    found = al.worst_case(SCENARIO, BOX, {"tau_peak": 100.0}, **FEW)
    assert found.values["run.q0[0]"] == 1.3
    assert found.margin == pytest.approx(1.0 - 100.0 * 2.0 * 0.3 / 100.0, rel=1e-12)
    without = al.worst_case(SCENARIO, BOX, "tau_peak", **FEW)
    assert without.margin == pytest.approx(-60.0, rel=1e-12)


def test_same_seed_same_bits_and_progress() -> None:
    calls: list[tuple[int, float]] = []
    one = al.worst_case(SCENARIO, BOX, "error_rms", threads=1, progress=lambda done, least: calls.append((done, least)), **FEW)
    two = al.worst_case(SCENARIO, BOX, "error_rms", threads=3, **FEW)
    for name in one.tried:
        assert one.tried[name].tobytes() == two.tried[name].tobytes()
    assert calls[-1] == (one.runs + one.gradients, one.tried["margin"].min())
    assert [least for _, least in calls] == sorted((least for _, least in calls), reverse=True)
    other = al.worst_case(SCENARIO, BOX, "error_rms", seed=1, **FEW)
    assert not np.array_equal(one.tried["law.kd"], other.tried["law.kd"])


def test_many_runs_are_reported_in_pieces_and_can_be_interrupted(interrupted: Callable[[str], tuple[list[str], float]]) -> None:
    done: list[int] = []
    search = CubeSearch(lambda u: u.sum(axis=1), lambda u: None, [Axis("ordered")], 5000, 0)
    search.search(np.array([0.5]), 1, lambda runs, least: done.append(runs))
    assert done[:3] == [1024, 2048, 2500]
    words, seconds = interrupted(
        """
        import armlet as al
        arm, law = {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5}, {"kind": "PDGravity", "target": [1.0, 0.0], "kp": 100.0, "kd": 20.0}
        scenario = al.Scenario({"arm": arm, "law": law, "run": {"q0": [0.9, 0.0], "t_end": 5.0, "dt": 1e-3}})
        print("ready", flush=True)
        try:
            al.worst_case(scenario, {"law.kd": {"uniform": [18.0, 22.0]}}, "error_rms", runs=10**5)
        except KeyboardInterrupt:
            print("stopped", flush=True)
        """
    )
    assert words == ["stopped"] and seconds < 5.0


def limits_margin(run: al.Run) -> float:
    """The margin "limits", from its definition: the smallest distance to a limit, divided by half the range of the joint."""
    assert run.limits is not None and run.tau is not None
    low, high = run.limits["q_min"], run.limits["q_max"]
    with np.errstate(invalid="ignore"):
        inside = np.minimum(run.q - low, high - run.q) / ((high - low) / 2.0)
    speed, effort = 1.0 - np.abs(run.v) / run.limits["v_max"], 1.0 - np.abs(run.tau) / run.limits["effort"]
    return float(min(np.nanmin(inside[:, 1]), speed.min(), effort.min()))


@pytest.mark.parametrize(
    ("name", "criterion"),
    [
        ("payload", {"error_rms": [1.5, 0.2]}),
        ("payload", {"error_peak": 1.0, "tau_peak": [30.0, 10.0]}),
        ("payload", "error_final"),
        ("limits", "limits"),
        ("limits", {"tau_rms": 10.0}),
        ("limits", {"input_ratio": 1.0}),
    ],
)
def test_slopes_of_margins_by_differences(name: str, criterion: Any) -> None:
    """The gradient of the margin along the box equals a central difference of the margins of runs."""
    from armlet.sweeping.worst import _box, _Loops

    scenario, box, _ = LOOPS[name]
    measured = Criterion("worst_case", criterion, {})
    loops = _Loops(scenario, _box(box, 0), measured, 1)
    point = np.random.default_rng(4).uniform(0.3, 0.7, len(box))
    found = loops.slope(point)
    assert found is not None and not loops.notes
    direction, step = np.random.default_rng(5).uniform(-1.0, 1.0, len(box)), 1e-5
    if measured.measures_errors:
        direction[[path.startswith("law.target") for path in box]] = 0.0
    low, high = loops.margins(np.array([point - step * direction, point + step * direction]))
    assert found @ direction == pytest.approx((high - low) / (2.0 * step), rel=2e-5)


def test_limits_from_their_definition() -> None:
    scenario, box, _ = LOOPS["limits"]
    found = al.worst_case(scenario, box, "limits", **FEW)
    assert found.margin == pytest.approx(limits_margin(found.run), rel=1e-12)
    with pytest.raises(al.InputError, match="worst_case: criterion limits is not possible for this arm"):
        al.worst_case(SCENARIO, BOX, "limits", **FEW)


def test_a_function_of_a_run_with_and_without_slopes() -> None:
    def swing(run: Any) -> float:
        return -float(np.abs(run.v).max())

    def end(run: Any) -> Any:
        slopes = np.zeros_like(run.q)
        slopes[-1, 0] = -2.0 * (run.q[-1, 0] - 1.0)
        return -float((run.q[-1, 0] - 1.0) ** 2), {"q": slopes}

    plain, sloped = al.worst_case(SCENARIO, BOX, swing, **FEW), al.worst_case(SCENARIO, BOX, end, **FEW)
    assert plain.gradients == 0 and plain.criterion == "swing" and plain.margin == swing(plain.run)
    assert sloped.gradients > 0 and sloped.values["run.q0[0]"] == 1.3
    with pytest.raises(al.InputError, match="criterion returned NaN"):
        al.worst_case(SCENARIO, BOX, lambda run: math.nan, **FEW)
    with pytest.raises(KeyError, match="mine"):
        al.worst_case(SCENARIO, BOX, lambda run: {}["mine"], **FEW)


def test_a_run_that_fails_is_worst_and_is_reported() -> None:
    unstable = SCENARIO.replace({"run.dt": 0.05, "run.t_end": 40.0})
    found = al.worst_case(unstable, {"law.kd": {"uniform": [5.0, 200.0]}}, {"error_peak": 1.0}, **FEW)
    assert found.margin == -math.inf and found.run.status == al.Status.DIVERGED and found.failed > 0
    assert found.runs == 12  # a smaller margin than -inf does not exist, so the search ends after its starts
    assert "this run ended early: diverged" in str(found) and f"{found.failed} runs ended early" in str(found)
    function = al.worst_case(unstable, {"law.kd": {"uniform": [5.0, 200.0]}}, lambda run: 1.0, **FEW)
    assert function.margin == -math.inf


def test_a_run_that_does_not_settle_is_worst() -> None:
    found = al.worst_case(SCENARIO, {"law.kd": {"uniform": [1.0, 30.0]}}, {"settling_time": 0.4}, **FEW)
    assert found.margin == -math.inf and found.failed == 0


def test_values_without_derivatives_do_not_stop_the_others() -> None:
    """A length is a constant of the loop's program. The gradient of the other values is used, and a note reports the length."""
    arm = {"kind": "planar_arm", "lengths": [0.5, 0.4], "masses": [3.0, 2.0]}
    scenario = al.Scenario(LOOPS["payload"][0].data | {"arm": arm, "plant": {"kind": "RigidArm"}})
    box = {"arm.lengths[0]": {"uniform": [0.45, 0.55]}, "arm.masses[1]": {"uniform": [1.0, 3.0]}}
    found = al.worst_case(scenario, box, {"error_peak": 0.1}, **FEW)
    assert found.gradients > 0 and any("arm.lengths[0] has no derivative" in note for note in found.notes)


def test_pickle_and_text() -> None:
    found = al.worst_case(SCENARIO, BOX, {"error_peak": [0.5, 0.5]}, **FEW)
    again = pickle.loads(pickle.dumps(found))
    assert again.margin == found.margin and again.values == found.values and str(again) == str(found)
    assert "smallest margin found 0.4 of error_peak <= [0.5, 0.5] (lower bound of the worst case" in str(found)
    assert repr(found) == f"WorstCase(margin 0.4, {found.runs} runs, success)"


def test_the_table_of_a_scenario_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`armlet worst` uses the table [worst], and writes a scenario that repeats the search."""
    table = {"vary": BOX, "criterion": {"error_peak": 0.5}, "runs": 24, "starts": 2, "seed": 3}
    scenario = al.Scenario(SCENARIO.data | {"worst": table})
    file = tmp_path / "hold.toml"
    scenario.save(file)
    assert cli.main(["worst", str(file), "--out", str(tmp_path / "out"), "--plot"]) == 0
    out = capsys.readouterr().out
    found = al.worst_case(file)
    assert out.startswith(str(found)) and out.count("wrote ") == 3
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["hold.worst.csv", "hold.worst.png", "hold.worst.toml"]
    assert al.Scenario.load(tmp_path / "out" / "hold.worst.toml").data == found.scenario.data
    other = al.worst_case(file, {"law.kd": {"uniform": [18.0, 22.0]}}, "tau_peak", runs=10)
    assert list(other.values) == ["law.kd"] and other.runs <= 10


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"criterion": {"error_peek": 0.5}}, None),
        ({"runs": 3}, "$.worst.runs: expected an integer >= 8, got 3"),
        ({"vary": {}}, "$.worst.vary: expected a table with at least one entry, got an empty table"),
        ({"vary": {"law.kd": {"unform": [1.0, 2.0]}}}, "unknown key 'unform' (did you mean uniform?)"),
        ({"criterion": {"error_peak": -0.5}}, '$.worst.criterion."error_peak": expected > 0, got -0.5'),
        ({"criterium": "limits"}, "$.worst: unknown key 'criterium' (did you mean criterion?)"),
    ],
)
def test_faults_of_the_table(changes: dict[str, Any], message: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from armlet.scenario.toml import toml_text

    file = tmp_path / "hold.toml"
    file.write_text(toml_text(SCENARIO.data | {"worst": {"vary": BOX, "criterion": "error_peak"} | changes}))
    assert cli.main(["worst", str(file)]) == 2
    err = capsys.readouterr().err
    assert (message or "criterion has an unknown name (did you mean error_peak?)") in err and len(err.splitlines()) == 1
    SCENARIO.save(file)
    assert cli.main(["worst", str(file)]) == 2 and "$.worst: is missing" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("vary", "criterion", "options", "message"),
    [
        ({}, "error_rms", {}, "worst_case: vary is empty"),
        (None, "error_rms", {}, "worst_case: vary is missing"),
        (BOX, None, {}, "worst_case: criterion is missing"),
        ({"law.kd": {"normal": [1.0, 2.0]}}, "error_rms", {}, 'worst_case: vary."law.kd" has no bounds'),
        ({"law.kd": {"uniform": [2.0, 1.0]}}, "error_rms", {}, 'worst_case: vary."law.kd": expected low <= high'),
        ({"law.kd": {"uniform": [2.0, math.nan]}}, "error_rms", {}, r'worst_case: vary."law.kd": expected uniform = \[low, high\]'),
        ({"law.kd": {"integers": [1.5, 3.0]}}, "error_rms", {}, 'worst_case: vary."law.kd": expected integers low <= high'),
        ({"law.kx": {"uniform": [1.0, 2.0]}}, "error_rms", {}, "worst_case: cell 0 .*unknown key 'kx'"),
        (BOX, "error_rm", {}, r"worst_case: criterion has an unknown name \(did you mean error_rms\?\)"),
        (BOX, "completed", {}, "worst_case: criterion has an unknown name"),
        (BOX, 3.0, {}, "worst_case: criterion is of the wrong type"),
        (BOX, {}, {}, "worst_case: criterion is of the wrong type"),
        (BOX, {"error_rms": 0.0}, {}, r"worst_case: criterion\['error_rms'\] is not a bound: expected finite numbers > 0, got 0.0"),
        (BOX, {"error_rms": math.inf}, {}, r"criterion\['error_rms'\] is not a bound"),
        (BOX, {"error_rms": "much"}, {}, r"criterion\['error_rms'\]"),
        (BOX, {"error_rms": [1.0, 1.0, 1.0]}, {}, r"criterion\['error_rms'\] has the wrong shape: expected a number or \(2,\), got \(3,\)"),
        (BOX, {"settling_time": [1.0, 1.0]}, {}, r"criterion\['settling_time'\] has the wrong shape: expected a number, got \(2,\)"),
        (BOX, "position_error_peak", {}, "criterion position_error_peak is not a metric of this loop"),
        (BOX, "time_outside_limits", {}, "criterion time_outside_limits has no value in this loop"),
        (BOX, "error_rms", {"runs": 7}, "worst_case: runs is not a count: expected an integer >= 8, got 7"),
        (BOX, "error_rms", {"starts": 0}, "worst_case: starts is not a count"),
        (BOX, "error_rms", {"seed": -1}, "worst_case: seed is not a count"),
        (BOX, "error_rms", {"progress": 1.0}, "worst_case: progress is not callable"),
        (BOX, "error_rms", {"bnd": 1.0}, "worst_case: metrics is unknown"),
    ],
)
def test_refusals(vary: Any, criterion: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        al.worst_case(SCENARIO, vary, criterion, **(FEW | options))


Cube = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def searched(value: Cube, slope: Any, axes: list[Axis], budget: int) -> CubeSearch:
    search = CubeSearch(value, slope, axes, budget, seed=0)
    search.search(np.full(len(axes), 0.5), 4, lambda done, least: None)
    assert len(search.values) + search.gradients <= budget
    assert all(np.all((point >= 0.0) & (point <= 1.0)) for point in search.points)
    return search


def test_the_search_in_a_cube() -> None:
    """A quadratic function: its minimum inside of the cube, on a face, and without derivatives."""
    centre = np.array([0.3, 0.8, 0.55, 0.1])
    weights = np.array([1.0, 4.0, 2.0, 3.0])

    def value(u: NDArray[np.float64]) -> NDArray[np.float64]:
        return (weights * (u - centre) ** 2).sum(axis=-1)

    smooth, ordered = [Axis("smooth")] * 4, [Axis("ordered")] * 4
    inside = searched(value, lambda u: 2.0 * weights * (u - centre), smooth, 400)
    assert inside.values[inside.best] < 2e-4 and inside.gradients > 0
    without = searched(value, lambda u: None, ordered, 400)
    assert without.values[without.best] < 2e-4 and without.gradients == 0
    centre[1] = 1.7
    face = searched(value, lambda u: 2.0 * weights * (u - centre), smooth, 400)
    assert face.points[face.best][1] == 1.0 and face.values[face.best] - 4.0 * 0.7**2 < 1e-4


def test_the_gradient_reaches_a_corner_of_many_coordinates() -> None:
    """A linear function of 40 coordinates: one of its 10^12 corners is the minimum. A step along the signs reaches it."""
    slope = np.random.default_rng(2).normal(size=40)
    search = searched(lambda u: u @ slope, lambda u: slope, [Axis("smooth")] * 40, 60)
    np.testing.assert_array_equal(search.points[search.best], (slope < 0.0).astype(float))
    assert search.stages[search.best] == "gradient" and search.gradients <= 3 * 4


def test_the_starts_have_the_corners_and_every_interval() -> None:
    search = searched(lambda u: u.sum(axis=1) * 0.0, lambda u: None, [Axis("ordered")] * 2, 100)
    starts = np.array([point for point, stage in zip(search.points, search.stages, strict=True) if stage == "start"])
    assert len(starts) == 50 and (starts[0] == 0.5).all()
    assert {tuple(corner) for corner in starts[1:5]} == {(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)}
    for column in starts[5:].T:
        np.testing.assert_array_equal(np.sort(np.floor(column * 45)), np.arange(45))


def test_tables_written_as_toml() -> None:
    """Every kind of value that a scenario can have, with keys and texts that need quotes."""
    import tomllib

    from armlet.scenario.toml import toml_text

    tables: dict[str, Any] = {
        "title": 'a "quoted" \\ text\nwith two lines \x7f ü',
        "flag": True,
        "other": False,
        "number": [1, -2.5, 1e-300, math.inf, -math.inf, 10**15],
        "rows": [[1.0, 0.0], [0.0, 1.0]],
        "a": {"b": {"law.kp[0]": {"uniform": [0.0, 1.0]}, "empty": {}}, "late": "value"},
        "tables": [{"kind": "Task", "target": {"kind": "Hold", "q": [0.1]}}, {"t": 1}],
    }
    assert tomllib.loads(toml_text(tables)) == tables


def test_discrete_coordinates() -> None:
    """Every value of a small list is tried, and consecutive values are drawn together."""

    def value(u: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.abs(u[:, 0] - 0.35) + (np.abs(u[:, 1] - 0.9) > 0.05)

    search = searched(value, lambda u: None, [Axis("ordered", 10), Axis("free", 10)], 100)
    np.testing.assert_allclose(search.points[search.best], [0.35, 0.95])
    seeds = searched(lambda u: u[:, 0], lambda u: None, [Axis("free", 1000, consecutive=True)], 20)
    steps = np.diff(np.array([point[0] for point in seeds.points[1:10]]) * 1000.0)
    np.testing.assert_allclose(steps % 1000.0, 1.0)
    assert searched(lambda u: u[:, 0], lambda u: None, [Axis("free", 3)], 50).converged
