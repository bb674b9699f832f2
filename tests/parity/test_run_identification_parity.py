"""Parameters identified from records of closed loops against least squares with runs and differences of `armlet.reference`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from loops import pair
from numpy.typing import NDArray

import armlet as al
from armlet import reference

Array = NDArray[np.float64]

START, END = np.array([0.2, -0.1]), np.array([0.9, 0.7])
GAINS: dict[str, Any] = {"kp": np.array([9.0, 7.0]), "kd": np.array([2.5, 3.0])}
STIFFNESS, MOTORS = np.array([90.0, 60.0]), np.array([0.2, 0.1])
OPTIONS: dict[str, Any] = {"dt": 1e-2, "sample_time": None}
DURATION = 0.2  # s


def motor_law(side: Any, arm: Any) -> Any:
    return side.MotorPD(arm, END, GAINS["kp"], GAINS["kd"], STIFFNESS)


def records(run: Any) -> Array:
    """Return positions and velocities (records, 2 n) of a run of either library."""
    q, v = (run["q"], run["v"]) if isinstance(run, dict) else (run.q, run.v)
    return np.concatenate([q, v], axis=1)


@pytest.mark.slow
def test_joint_friction() -> None:
    """Damping and Coulomb friction of two joints from a noisy record: values and standard deviations agree."""
    ours, theirs = pair(np.random.default_rng(3), 2)
    rng, names = np.random.default_rng(6), ["arm.damping", "arm.friction"]
    true, guess = np.array([0.6, 0.5, 0.3, 0.2]), np.array([0.4, 0.4, 0.2, 0.3])

    def loop(side: Any, arm: Any, p: Array) -> tuple[Any, Any]:
        plant = side.RigidArm(arm.with_drives(damping=p[:2], friction=p[2:]), friction=True)
        return plant, side.PDGravity(arm, END, GAINS["kp"], GAINS["kd"])

    made = al.simulate(*loop(al, ours, true), START, t_end=DURATION, **OPTIONS)
    q, v = (x + 1e-4 * rng.standard_normal(x.shape) for x in (made.q, made.v))
    q[0], v[0] = made.q[0], made.v[0]  # the start is exact
    record = al.Run({"t": made.t, "q": q, "v": v})
    plant, law = loop(al, ours, guess)
    found = al.identify_from_runs(record, names, plant=plant, law=law, noise={"q": 1e-4, "v": 1e-4}, **OPTIONS)

    def run(p: Array) -> Array:
        return records(reference.simulate(*loop(reference, theirs, p), START, t_end=DURATION, **OPTIONS))

    expected, sigma = reference.fit(run, records(record), guess, 1e-4, 4)
    values, deviations = (np.concatenate([part[name] for name in names]) for part in (found.values, found.deviations))
    assert found.converged and found.rank == 4
    # Both searches stop near the minimum, within 1e-3 of a standard deviation.
    np.testing.assert_allclose(values, expected, rtol=0.0, atol=1e-3 * sigma.max())
    np.testing.assert_allclose(deviations, sigma, rtol=1e-4)
    assert np.all(np.abs(values - true) < 5.0 * deviations)


@pytest.mark.slow
@pytest.mark.parametrize("known", [False, True], ids=["noise estimated", "noise known"])
def test_stiffness(known: bool) -> None:
    """The stiffness of two joints from two noisy records: values and standard deviations agree."""
    ours, theirs = pair(np.random.default_rng(3), 2)
    rng, law = np.random.default_rng(5), motor_law(al, ours)
    true, starts = np.array([100.0, 50.0]), [START, START + 0.3]
    noise = {"q": 1e-3, "v": np.array([4e-3, 3e-3])}
    made = [al.simulate(al.ElasticArm(ours, true, MOTORS), law, q0, t_end=DURATION, **OPTIONS) for q0 in starts]
    runs = []
    for run in made:
        q = run.q + 1e-3 * rng.standard_normal(run.q.shape)
        v = run.v + noise["v"] * rng.standard_normal(run.v.shape)
        q[0], v[0] = run.q[0], run.v[0]  # the start is exact
        runs.append(al.Run({"t": run.t, "q": q, "v": v}))
    plant = al.ElasticArm(ours, STIFFNESS, MOTORS)
    options: dict[str, Any] = {"plant": plant, "law": law, "noise": noise if known else None}
    found = al.identify_from_runs(runs, "plant.stiffness", **options, **OPTIONS)

    def run(stiffness: Array) -> Array:
        plant = reference.ElasticArm(theirs, stiffness, MOTORS)
        own = [reference.simulate(plant, motor_law(reference, theirs), q0, t_end=DURATION, **OPTIONS) for q0 in starts]
        return np.stack([records(one) for one in own])

    measured = np.stack([records(one) for one in runs])
    if known:
        expected, sigma = reference.fit(run, measured, STIFFNESS, np.concatenate([np.full(2, 1e-3), noise["v"]]), 4)
    else:  # each series divided by its range
        spread = np.ptp(measured.reshape(-1, 4), axis=0)
        expected, sigma = reference.fit(lambda at: run(at) / spread, measured / spread, STIFFNESS, None, 4)
    # Both searches reach the same minimum, up to the square root of the rounding error of the sums.
    np.testing.assert_allclose(found.values["plant.stiffness"], expected, rtol=1e-6)
    np.testing.assert_allclose(found.deviations["plant.stiffness"], sigma, rtol=1e-4)
    assert np.all(np.abs(expected - true) < 5.0 * sigma) and found.converged and found.rank == 2
    assert isinstance(found, al.RunIdentification)
    again = al.simulate(found.plant, found.laws[0], START, t_end=DURATION, **OPTIONS)
    np.testing.assert_array_equal(again.q, found.runs[0].q)


@pytest.mark.slow
def test_stiffness_and_starts() -> None:
    """The initial states of two records are unknown, too. Each record has its own."""
    ours, theirs = pair(np.random.default_rng(3), 2)
    rng, law = np.random.default_rng(7), motor_law(al, ours)
    starts = [(START, np.array([0.5, 0.2])), (START + 0.3, np.array([-0.5, 0.1]))]
    runs = []
    for q0, v0 in starts:
        run = al.simulate(al.ElasticArm(ours, np.array([100.0, 50.0]), MOTORS), law, q0, v0=v0, t_end=DURATION, **OPTIONS)
        q, v = run.q + 1e-3 * rng.standard_normal(run.q.shape), run.v + 5e-3 * rng.standard_normal(run.v.shape)
        runs.append(al.Run({"t": run.t, "q": q, "v": v}))
    noise, plant = {"q": 1e-3, "v": 5e-3}, al.ElasticArm(ours, STIFFNESS, MOTORS)
    found = al.identify_from_runs(
        runs, ["plant.stiffness", "q0", "v0"], plant=plant, law=law, noise=noise, tolerance=1e-12, iterations=30, **OPTIONS
    )

    def run(p: Array) -> Array:
        plant, own = reference.ElasticArm(theirs, p[:2], MOTORS), motor_law(reference, theirs)
        each = [reference.simulate(plant, own, p[k : k + 2], v0=p[k + 2 : k + 4], t_end=DURATION, **OPTIONS) for k in (2, 6)]
        return np.stack([records(one) for one in each])

    # The search of the reference starts near its minimum, at the true values, because each of its steps takes 40 runs in numpy.
    first = np.concatenate([[100.0, 50.0], *(np.concatenate(start) for start in starts)])
    expected, sigma = reference.fit(run, np.stack([records(one) for one in runs]), first, np.array([1e-3, 1e-3, 5e-3, 5e-3]), 2)

    def joined(by: dict[str, Array]) -> Array:
        return np.concatenate([by["plant.stiffness"], *(np.concatenate(each) for each in zip(by["q0"], by["v0"], strict=True))])

    # Both searches reach the same minimum, up to the square root of the rounding error of the sums, relative to the standard deviations.
    np.testing.assert_allclose(joined(found.values), expected, rtol=0.0, atol=1e-4 * sigma.max())
    np.testing.assert_allclose(joined(found.values)[:2], expected[:2], rtol=1e-6)
    np.testing.assert_allclose(joined(found.deviations), sigma, rtol=1e-4)


def record(t: list[float], q: float = 0.0) -> al.Run:
    return al.Run({"t": t, "q": np.full((len(t), 2), q), "v": np.zeros((len(t), 2))})


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "no run": ({"runs": 3.0}, "runs is of the wrong type"),
    "no names": ({"names": []}, "names is not a list of names"),
    "unknown": ({"names": ["plant.stiffness", "plant.mass"]}, r"got 'plant.mass' \(first bad index 1\)"),
    "two laws": ({"law": [1, 2]}, "law has the wrong length: expected 1"),
    "law in Python": ({"law": lambda t, q, v: q}, "law"),
    "plant": ({"plant": 1.0}, "plant"),
    "noise of one": ({"noise": {"q": 1.0}}, "noise is wrong"),
    "noise that is zero": ({"noise": {"q": 1.0, "v": [0.0, 1.0]}}, r"noise\['v'\] is out of range"),
    "noise that is NaN": ({"noise": {"q": np.nan, "v": 1.0}}, r"noise\['q'\]"),
    "iterations": ({"iterations": -1}, "iterations is not a count"),
    "tolerance": ({"tolerance": "much"}, "tolerance"),
    "times": ({"t_end": 1.0}, "t_end is not used"),
    "short": ({"runs": record([0.0])}, "runs has no such record"),
    "later": ({"runs": record([1.0, 2.0])}, "runs has no such record"),
    "NaN": ({"runs": record([0.0, 1.0], np.nan)}, r"runs is not finite.*first bad index 0"),
    "few": ({"runs": record([0.0, 0.01]), "names": "arm.parameters"}, "runs are too short"),
}


@pytest.mark.parametrize("case", BAD)
def test_refusals(case: str) -> None:
    ours, _ = pair(np.random.default_rng(3), 2)
    law, plant = motor_law(al, ours), al.ElasticArm(ours, STIFFNESS, MOTORS)
    changes, message = BAD[case]
    given = {"runs": al.simulate(plant, law, START, t_end=0.1, **OPTIONS), "names": "plant.stiffness", "plant": plant, "law": law} | changes
    runs, names = given.pop("runs"), given.pop("names")
    with pytest.raises(al.InputError, match=message):
        al.identify_from_runs(runs, names, **given, **OPTIONS)
