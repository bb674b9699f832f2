"""Metrics of a run, by definition and for synthetic records; and export of results: CSV, Parquet, xarray, figures, animations."""

from __future__ import annotations

import pickle
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import models
import numpy as np
import pytest
from matplotlib.figure import Figure

import armlet as al
from armlet.run import BatchRun, Run
from armlet.run.metrics import PER_JOINT, PER_RUN

T = np.linspace(0.0, 10.0, 10001)
LIMITS = {"q_min": [-9.0, -9.0], "q_max": [1.2, 9.0], "v_max": [9.0, 9.0], "effort": [9.0, 9.0]}


def made(**changes: Any) -> Run:
    """A synthetic run: q1 oscillates to 1 with error exp(-t) cos(4 t), q2 is constant; tau1 = 3 sin(2 pi t), tau2 = -2."""
    swing = np.exp(-T) * np.cos(4.0 * T)
    fields: dict[str, Any] = {"t": T, "q": np.stack([1.0 - swing, 0.5 + 0.0 * T], 1), "v": np.zeros((len(T), 2))}
    fields |= {"tau": np.stack([3.0 * np.sin(2 * np.pi * T), -2.0 + 0.0 * T], 1), "target": np.array([1.0, 0.5])}
    fields |= {"limits": {name: np.array(value) for name, value in LIMITS.items()}, "units": ("rad", "rad"), "law_name": "PDGravity"}
    return Run(fields | changes)


def test_metrics_by_definition() -> None:
    found = made().metrics()
    assert tuple(found) == (*PER_JOINT, *PER_RUN)
    # int_0^inf exp(-2 t) cos(4 t)^2 dt = 1/4 + 1/4 Re 1/(1 - 4i) = 1/4 (1 + 1/17), over 10 s. The error of the grid is about 1e-7.
    np.testing.assert_allclose(found["error_rms"], [np.sqrt(0.25 * (1 + 1 / 17) / 10.0), 0.0], atol=1e-6)
    np.testing.assert_array_equal(found["error_peak"], [1.0, 0.0])
    # The first overshoot is the minimum of exp(-t) cos(4 t) after t = pi/8, at tan(4 t) = -1/4.
    t = (np.pi - np.arctan(0.25)) / 4.0
    np.testing.assert_allclose(found["overshoot"], [-np.exp(-t) * np.cos(4 * t), np.nan], rtol=1e-6)
    np.testing.assert_allclose(found["tau_rms"], [3.0 / np.sqrt(2.0), 2.0], rtol=1e-9)
    np.testing.assert_allclose(found["tau_peak"], [3.0, 2.0], rtol=1e-6)
    # The run has settled at the record after the last one outside of the band.
    last = T[np.abs(np.exp(-T) * np.cos(4.0 * T)) > 0.02].max()
    np.testing.assert_allclose(found["settling_time"], last + 1e-3, atol=1e-12)
    outside = np.sum(1.0 - np.exp(-T) * np.cos(4 * T) > 1.2) * 1e-3
    np.testing.assert_allclose(found["time_outside_limits"], outside, rtol=1e-9)
    assert found["monitor_violations"] == 0


def test_units_and_columns() -> None:
    found = made(units=("m", "rad")).metrics()
    assert [found.unit("error_rms", i) for i in (0, 1)] == ["m", "rad"] and [found.unit("tau_peak", i) for i in (0, 1)] == ["N", "N m"]
    assert found.unit("settling_time") == "s" and found.unit("overshoot") == "1"
    columns = found.columns()
    assert list(columns)[:2] == ["error_rms1", "error_rms2"] and "settling_time" in columns and columns["tau_rms2"] == pytest.approx(2.0)
    text = str(found)
    assert "2.12132 N  2 N m" in text and len(text.splitlines()) == len(found)
    again = pickle.loads(pickle.dumps(found))
    assert again.units == found.units and str(again) == text


def test_units_of_commanded_velocities(tmp_path: Path) -> None:
    """The plant determines the units of the input. Files, pickles and rows of batches keep them."""
    plant = al.VelocityArm(models.TWO_LINKS)
    law = lambda t, q: [0.1, 0.1]  # noqa: E731
    run = al.simulate(plant, law, [0.0, 0.0], t_end=0.02, dt=0.01, sample_time=0.01)
    run.save(tmp_path / "run.npz")
    tip = al.PriorityVelocity(plant.arm, [al.Task("link2", "xy", [0.6, 0.3], 5.0)])
    batch = al.simulate_batch(plant, tip, [[0.3, 0.4]], t_end=0.02, dt=0.01)
    for found in (run, pickle.loads(pickle.dumps(run)), al.load(tmp_path / "run.npz"), batch, batch[0]):
        assert found.input_units == ("rad/s", "rad/s") and found.units == ("rad", "rad")


def test_options() -> None:
    run = made()
    assert run.metrics(band=2.0)["settling_time"] == 0.0
    assert np.isnan(run.metrics(band=1e-9)["settling_time"])
    assert run.metrics(settle=0.5)["settling_time"] < run.metrics()["settling_time"]
    assert run.metrics(reference=[0.0, 0.0])["error_final"][1] == 0.5
    with pytest.raises(al.InputError, match=r"reference has the wrong shape: expected \(2,\) or \(10001, 2\), got \(3,\)"):
        run.metrics(reference=[0.0, 0.0, 0.0])


def test_without_a_reference_or_limits() -> None:
    found = made(target=None, limits=None, law_name="CartesianImpedance").metrics()
    assert all(np.isnan(found[name]).all() for name in (*PER_JOINT[:4], "settling_time", "time_outside_limits"))
    assert np.isfinite(found["tau_rms"]).all() and "error_rms            -  -" in str(found)


def test_violations() -> None:
    energy = np.ones(len(T))
    balance, lyapunov = np.zeros(len(T)), np.linspace(1.0, 0.0, len(T))
    balance[[5, 7]] = 1e-5, np.nan
    lyapunov[100] += 0.1  # an increase at one record
    monitors = {"energy": energy, "energy_balance": balance, "lyapunov": lyapunov, "skewness": 0.0 * T}
    assert made(monitors=monitors).metrics()["monitor_violations"] == 3
    assert made(monitors=monitors).metrics(tolerance=1e-4)["monitor_violations"] == 2
    assert made(monitors=monitors).metrics(tolerance=1.0)["monitor_violations"] == 1  # NaN is a violation at every tolerance


def test_a_run_that_stopped_being_finite() -> None:
    q = made().q.copy()
    q[5000:] = np.nan
    found = made(q=q, status=1).metrics()
    assert found.pop("completed") == 0.0
    assert all(np.isnan(values).all() for values in found.values())


def test_rows_of_a_batch_are_runs() -> None:
    """Metrics of a batch, computed for all rows together, equal those of each row, with a common motion and with separate motions."""
    arm = models.TWO_LINKS
    q0 = np.random.default_rng(3).uniform(-0.3, 0.3, (5, 2))
    ends = np.random.default_rng(4).uniform(0.2, 0.9, (5, 2))
    motions = [al.Quintic([0.0, 0.0], end, 0.3) for end in ends]
    for laws in (
        al.ComputedTorque(arm, motions[0], 100.0, 20.0),
        [al.ComputedTorque(arm, motions[0], gain, 20.0) for gain in (50.0, 60.0, 70.0, 80.0, 90.0)],
        [al.ComputedTorque(arm, motion, 100.0, 20.0) for motion in motions],
        [al.PDGravity(arm, end, 100.0, 5.0) for end in ends],
    ):
        batch = al.simulate_batch(al.RigidArm(arm), laws, q0, t_end=0.5, dt=1e-3)
        found = batch.metrics()
        assert found["error_rms"].shape == (5, 2) and found["settling_time"].shape == (5,)
        for i, run in enumerate(batch):
            for name, values in run.metrics().items():
                np.testing.assert_allclose(found[name][i], values, rtol=1e-12, atol=1e-15, err_msg=name)
    with pytest.raises(al.InputError, match='expected a batch run with keep="all"'):
        al.simulate_batch(al.RigidArm(arm), laws, q0, t_end=0.5, dt=1e-3, keep="final").metrics()


def test_metrics_survive_the_disk(tmp_path: Path) -> None:
    run = made()
    run.save(tmp_path / "run.npz")
    loaded = al.load(tmp_path / "run.npz")
    assert str(loaded.metrics()) == str(run.metrics())
    batch = BatchRun({"t": T, "q": np.stack([run.q] * 2), "v": np.stack([run.v] * 2), "target": run.target, "limits": run.limits})
    batch.save(tmp_path / "batch.npz")
    loaded = al.load(tmp_path / "batch.npz")
    for name, values in batch.metrics().items():
        np.testing.assert_array_equal(loaded.metrics()[name], values)


def test_csv_gives_the_numbers_back(tmp_path: Path) -> None:
    run = made()
    run.to_csv(tmp_path / "run.csv")
    lines = (tmp_path / "run.csv").read_text().splitlines()
    table = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    assert lines[0] == "t,q1,q2,v1,v2,tau1,tau2"
    np.testing.assert_array_equal(table, np.column_stack([run.t, run.q, run.v, run.tau]))


def test_extras_that_are_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("pyarrow", "pyarrow.parquet", "xarray", "matplotlib"):
        monkeypatch.setitem(sys.modules, name, None)
    run = made()
    with pytest.raises(
        ImportError, match=r"^Run\.to_parquet: pyarrow is not installed: pip install '\.\[data\]' in the folder of armlet's sources$"
    ):
        run.to_parquet(tmp_path / "run.parquet")
    with pytest.raises(
        ImportError, match=r"^Run\.to_xarray: xarray is not installed: pip install '\.\[data\]' in the folder of armlet's sources$"
    ):
        run.to_xarray()
    with pytest.raises(
        ImportError, match=r"^compare: matplotlib is not installed: pip install '\.\[plot\]' in the folder of armlet's sources$"
    ):
        al.compare([run])
    assert not list(tmp_path.iterdir())


def test_xarray() -> None:
    data = made().to_xarray()
    assert data["q"].dims == ("t", "joint") and data["q"].attrs["units"] == "rad" and data["tau"].attrs["units"] == "N m"
    np.testing.assert_array_equal(data["q"].sel(joint=1), made().q[:, 0])


def test_parquet_hands_pyarrow_the_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """pyarrow is optional, so a replacement records its arguments and the file that it receives."""
    seen: dict[str, Any] = {}
    monkeypatch.setitem(sys.modules, "pyarrow", SimpleNamespace(array=np.asarray, table=lambda columns: seen.update(columns) or "table"))
    write = SimpleNamespace(write_table=lambda table, file: file.write(table.encode()))
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", write)
    made().to_parquet(tmp_path / "run.parquet")
    assert list(seen) == ["t", "q1", "q2", "v1", "v2", "tau1", "tau2"] and (tmp_path / "run.parquet").read_text() == "table"


def test_compare() -> None:
    figure = Figure()
    axes = al.compare([made(), made(tau=None), made()], ["a", "b", "c"], fig=figure)
    assert axes.shape == (2, 2) and [ax.get_ylabel() for ax in axes[:, 0]] == ["error (rad)", "input (N m)"]
    assert [len(ax.lines) for ax in axes[:, 0]] == [3, 2]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["a", "b", "c"]
    assert len({(line.get_color(), str(line.get_linestyle())) for line in axes[0, 0].lines}) == 3
    positions = al.compare([made(target=None), made()], fig=Figure())
    assert positions[0, 0].get_ylabel() == "position (rad)"
    for runs, labels, message in (([], None, "runs is empty"), ([made()], ["a", "b"], "expected 1, got 2")):
        with pytest.raises(al.InputError, match=message):
            al.compare(runs, labels)
    with pytest.raises(al.InputError, match="different arms"):
        al.compare([made(), made(units=("m", "rad"))])


def test_animate(tmp_path: Path) -> None:
    from PIL import Image

    arm = al.load_urdf(al.example_urdf("planar_2r"))
    run = al.simulate(al.RigidArm(arm), al.PDGravity(arm, [0.4, 0.5], 20.0, 4.0), [0.0, 0.0], t_end=1.0, dt=1e-3)
    run.animate(tmp_path / "a.gif", fps=10.0, size=200)
    with Image.open(tmp_path / "a.gif") as film:
        assert film.format == "GIF" and film.n_frames == 10 and film.size == (200, 200) and film.info["duration"] == 100
    run.save(tmp_path / "run.npz")
    loaded = al.load(tmp_path / "run.npz")
    assert isinstance(loaded, Run)
    with pytest.raises(al.InputError, match="arm is missing"):
        loaded.animate(tmp_path / "b.gif")
    loaded.animate(tmp_path / "b.gif", arm, fps=5.0, size=100)
    with pytest.raises(al.InputError, match=r"fps is out of range: expected a number in \(0, 50\], got 0"):
        run.animate(tmp_path / "c.gif", fps=0)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.gif", "b.gif", "run.npz"]


ONLY = {"q_min": [-9.0, -9.0], "q_max": [9.0, 9.0], "v_max": [9.0, 9.0], "effort": [9.0, 9.0]}


def outside(*, name: str, joint: int, value: float, law: str = "PDGravity", **limits: list[float]) -> float:
    """The time outside the limits, s. One quantity of one joint has the value `value` from 2 s to 5 s, and all others are zero."""
    fields: dict[str, Any] = {each: np.zeros((len(T), 2)) for each in ("q", "v", "tau")}
    fields[name][(T >= 2.0) & (T < 5.0), joint] = value
    stated = {each: np.array(numbers) for each, numbers in (ONLY | limits).items()}
    return float(made(**fields, limits=stated, law_name=law).metrics()["time_outside_limits"])


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("name", ["q", "v", "tau"])
def test_every_limit_has_two_sides(name: str, joint: int) -> None:
    """Each limit is exceeded for 3 s of 10 s, for position, speed and effort, both signs and both joints.

    A value on the limit is inside.
    """
    for value in (9.5, -9.5):
        assert outside(name=name, joint=joint, value=value) == pytest.approx(3.0, abs=1e-9)
    for value in (9.0, -9.0):
        assert outside(name=name, joint=joint, value=value) == 0.0


def test_the_input_of_a_velocity_plant_is_compared_with_speeds() -> None:
    """The input is a velocity, so `v_max` is its limit. The arm's effort limits have no effect."""
    command: dict[str, Any] = {"name": "tau", "joint": 1, "v_max": [2.0, 2.0], "effort": [0.1, 0.1]}
    assert outside(**command, value=1.0, law="PriorityVelocity") == 0.0
    assert outside(**command, value=1.0) == pytest.approx(3.0, abs=1e-9)
    fast: dict[str, Any] = {"name": "tau", "joint": 0, "v_max": [2.0, 2.0], "effort": [9.0, 9.0]}
    assert outside(**fast, value=-3.0, law="PriorityVelocity") == pytest.approx(3.0, abs=1e-9)
    assert outside(**fast, value=-3.0) == 0.0


def test_the_settling_band_is_shared_by_joints_of_one_unit() -> None:
    """q1 has an error of at most 1, so the common band is 0.02.

    The constant error 0.015 of q2 is inside; with a different unit it is not.
    """
    q = made().q.copy()
    q[:, 1] = 0.5 + 0.015
    alone = made().metrics()["settling_time"]
    assert made(q=q).metrics()["settling_time"] == alone
    assert np.isnan(made(q=q, units=("rad", "m")).metrics()["settling_time"])
    # With one band per joint, 0.01 rad is too narrow for q2.
    assert np.isnan(made(q=q).metrics(band=[0.02, 0.01])["settling_time"])
    assert made(q=q).metrics(band=[0.02, 0.02])["settling_time"] == alone


def test_a_mirrored_run_comes_to_the_same() -> None:
    """If the signs of state, input, target, limits and balances change, the metrics are equal."""
    one = made()
    wave = np.sin(T)
    balances = {"energy_balance": 1e-5 * wave, "lyapunov_balance": 2e-6 * wave + 1e-6, "skewness": 3e-6 * wave + 1e-6}
    held = {"energy": np.ones(len(T)), "lyapunov": np.linspace(1.0, 0.5, len(T))}
    limits = one.limits
    assert limits is not None
    flipped = limits | {"q_min": -limits["q_max"], "q_max": -limits["q_min"]}
    fields = {name: -getattr(one, name) for name in ("q", "v", "tau", "target")}
    mirrored = made(**fields, limits=flipped, monitors=held | {name: -values for name, values in balances.items()})
    found = mirrored.metrics()
    for name, values in made(monitors=held | balances).metrics().items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)
    assert 0 < found["monitor_violations"] < 3 * len(T) and found["overshoot"][0] > 0.3 and found["time_outside_limits"] > 0.1


def test_metrics_know_no_scale_and_no_start() -> None:
    """A later start, other units of energy, or rows with different times do not change the metrics."""
    monitors = {"lyapunov": 2.0 + np.cos(T), "lyapunov_balance": 1e-6 * np.sin(T)}
    monitors |= {"energy": np.ones(len(T)), "energy_balance": 2e-6 * np.sin(T)}
    wanted = made(monitors=monitors).metrics()
    assert 0 < wanted["monitor_violations"] < 2 * len(T)
    for scale in (2.0**-20, 2.0**20):
        scaled = made(monitors={name: scale * values for name, values in monitors.items()}).metrics()
        assert scaled["monitor_violations"] == wanted["monitor_violations"]
    later = made(t=T + 4.0).metrics()
    for name in ("error_rms", "settling_time", "time_outside_limits", "tau_rms"):
        np.testing.assert_allclose(later[name], wanted[name], rtol=1e-11, err_msg=name)
    run = made()
    fields = {name: np.stack([getattr(run, name)] * 2) for name in ("q", "v", "tau")}
    batch = BatchRun(fields | {"t": np.stack([T, 2.0 * T]), "target": run.target, "limits": run.limits, "law_name": "PDGravity"}).metrics()
    for name, times in (("error_rms", 1.0), ("tau_rms", 1.0), ("settling_time", 2.0), ("time_outside_limits", 2.0)):
        np.testing.assert_allclose(batch[name][0], wanted[name], rtol=1e-12, err_msg=name)
        np.testing.assert_allclose(batch[name][1], times * wanted[name], rtol=1e-12, err_msg=name)


def test_a_reference_that_still_moves_has_no_overshoot() -> None:
    run = made()
    q_d = np.stack([T / 10.0, 0.5 + 0.0 * T], 1)
    for speed, known in ((0.1, False), (0.0, True)):
        v_d = np.stack([speed + 0.0 * T, 0.0 * T], 1)
        found = made(desired=(q_d, v_d, 0.0 * v_d), target=None, law_name="ComputedTorque").metrics()
        assert np.isfinite(found["overshoot"][0]) == known and np.isnan(found["overshoot"][1]) and np.isfinite(found["error_rms"]).all()
    assert run.metrics()["overshoot"][0] > 0.0
