"""Derivatives of runs: with respect to drives, where contacts change, and for rows of a batch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from test_gradients import ARM, GAINS, LAWS, Q0, SWING, V0, B, K, compare, derivatives, elastic, plant_of, records

import armlet as al
from armlet.reference import sensitivity
from armlet.run.named_numbers import named_numbers

DRIVEN = ARM.with_drives(damping=[0.4, 0.3], friction=[0.2, 0.1], armature=[0.05, 0.02])
DRIVES: dict[str, tuple[Callable[[], Any], list[str]]] = {
    "ComputedTorque": (lambda: al.ComputedTorque(DRIVEN, SWING, **GAINS), ["law.arm.armature"]),
    "Adaptive": (lambda: al.Adaptive(DRIVEN, SWING, **GAINS, gamma=0.3, composite=0.3, composite_rate=8.0), ["law.arm.armature"]),
    "PID": (
        lambda: al.PID(DRIVEN, SWING, kp=[8.0, 6.0], ki=[2.0, 3.0], kd=[3.0, 2.0], friction=True),
        ["law.arm.armature", "law.arm.damping", "law.arm.friction"],
    ),
}


@pytest.mark.parametrize("name", DRIVES)
def test_the_drives_of_plant_and_law(name: str) -> None:
    """Derivatives with respect to rotor inertia, damping and Coulomb friction. No joint changes its direction."""
    law, names = DRIVES[name]
    options: dict[str, Any] = {"t_end": 0.04, "dt": 2e-3, "v0": np.array([1.5, 1.5])}
    for arm, control in ((DRIVEN, law()), (ARM, LAWS["PDGravity"]())):
        assert np.all(al.simulate(al.RigidArm(arm, friction=True), control, Q0, **options).v > 0.0)
    compare(al.RigidArm(DRIVEN, friction=True), law(), ["arm.damping", "arm.friction", "arm.armature", *names], options, 2e-9)
    # Without derivatives, parameters that are zero are constants of the compiled loop. Here they must be inputs.
    compare(al.RigidArm(ARM, friction=True), LAWS["PDGravity"](), ["arm.damping", "arm.friction", "arm.armature"], options, 2e-9)


WALL = al.Wall("link2", [0.85, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=3e3, damping=40.0)
STOPS = al.JointStops(2e3, 30.0, lower=-0.25, upper=0.25)
SPRING = al.PDGravity(ARM, [0.0, 0.0], kp=[30.0, 20.0], kd=[1.0, 1.0])
CONTACTS: dict[str, tuple[Any, Any, list[float], list[float], dict[str, Any], list[str]]] = {
    "wall": (
        al.RigidArm(ARM, wall=WALL),
        SPRING,
        [0.6, -0.4],
        [-2.0, -0.5],
        {"method": "dopri5", "rtol": 1e-11},
        ["plant.wall.stiffness", "law.kp"],
    ),
    "wall, sampled": (al.RigidArm(ARM, wall=WALL), SPRING, [0.6, -0.4], [-2.0, -0.5], {"sample_time": 5e-3}, ["plant.wall.damping"]),
    "stops": (al.RigidArm(ARM, stops=STOPS), SPRING, [0.2, -0.1], [4.0, -6.0], {}, ["plant.stops.stiffness", "plant.stops.upper"]),
    "stops of elastic joints": (
        al.ElasticArm(ARM, K, B, stops=STOPS),
        elastic(al.MotorPD),
        [0.2, -0.1],
        [4.0, -6.0],
        {"t_end": 0.08, "t_eval": [0.0, 0.08], "rtol": 1e-11},
        ["plant.stops.damping"],
    ),
}


@pytest.mark.parametrize("case", CONTACTS)
def test_tangents_jump_where_contacts_change(case: str) -> None:
    """Where contacts change, derivatives equal differences of runs, and the derivatives of the adjoint.

    The contact times of these runs differ.
    """
    plant, law, q0, v0, more, names = CONTACTS[case]
    names = ["v0", *names]
    options: dict[str, Any] = {"t_end": 0.24, "method": "dop853", "rtol": 1e-12, "atol": 1e-13, "t_eval": [0.0, 0.11, 0.24], **more}
    run = al.simulate(plant, law, q0, v0=v0, monitors=False, sensitivity=names, **options)
    assert run.sensitivity is not None
    start = {"q0": np.array(q0), "v0": np.array(v0), "theta0": None, "theta_dot0": None}
    known = named_numbers(plant, law, start)
    slopes = {each: np.random.default_rng(5).standard_normal(run.q.shape) for each in ("q", "v", "tau")}
    for name in names:
        # The change is so small that no record is on another side of an event.
        of = lambda at, name=name: records(plant, law, start, options, name, at)  # noqa: E731
        expected = sensitivity(of, known[name], np.where(known[name] == 0.0, 0.05, np.abs(known[name])), 1e-4)
        got = derivatives(run.sensitivity[name])
        assert np.abs(expected).max() > 1e-4
        # The difference quotient divides the errors of the runs by the relative change, 1e-4. The results agree to 4e-8.
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-7 * np.abs(expected).max(), err_msg=name)
        _, found = al.gradient(lambda _: (0.0, slopes), plant, law, q0, name, v0=v0, memory=1 << 12, **options)
        parts = [np.einsum("ki,kij->j", slopes[each], getattr(run.sensitivity[name], each)) for each in slopes]
        size = np.max(sum(np.abs(part) for part in parts))
        np.testing.assert_allclose(found[name].ravel(), sum(parts), rtol=0.0, atol=1e-11 * size)


ROWS: dict[str, dict[str, Any]] = {
    "fixed steps": {"dt": 2e-3},
    "adaptive steps and stops": {"method": "dop853", "t_eval": [0.0, 0.03, 0.06]},
    "jitter and noise": {"dt": 2e-3, "sample_time": al.Sampling(4e-3, jitter=2e-3, noise={"v": 0.01}, seed=3)},
    "a law for each row": {"dt": 2e-3},
}


@pytest.mark.parametrize("case", ROWS)
def test_rows_of_a_batch_have_the_numbers_of_their_runs(case: str) -> None:
    """Rows equal single runs to the last bit, for any number of threads. A row that does not reach its end has no derivatives."""
    rng, options = np.random.default_rng(7), {"t_end": 0.06, **ROWS[case]}
    q0, v0, names = 0.2 * rng.standard_normal((4, 2)), 4.0 * rng.standard_normal((4, 2)), ["law.kp", "q0", "arm.damping"]
    plant = al.RigidArm(ARM, friction=True, stops=STOPS if "stops" in case else None)
    v0[2, 0] = 1e7  # beyond the state limit
    laws = [al.PDGravity(ARM, [0.0, 0.0], kp=[30.0 + k, 20.0], kd=[1.0, 1.0]) for k in range(4)] if "each" in case else [SPRING] * 4
    keywords: dict[str, Any] = {"v0": v0, "check_limits": False, "monitors": False, **options}
    given = laws if "each" in case else SPRING
    batch, other = (al.simulate_batch(plant, given, q0, sensitivity=names, threads=threads, **keywords) for threads in (1, 3))
    values, slopes = al.gradient("error_rms", plant, given, q0, names, **keywords)
    assert batch.sensitivity is not None and other.sensitivity is not None
    for r in range(4):
        if r == 2:
            assert np.isnan(batch.sensitivity["q0"].q[r]).all() and np.isnan(values[r]) and np.isnan(slopes["law.kp"][r]).all()
            continue
        own = keywords | {"v0": v0[r]}
        if "sample_time" in own:
            own["sample_time"] = al.Sampling(4e-3, jitter=2e-3, noise={"v": 0.01}, seed=3 + r)
        alone = al.simulate(plant, laws[r], q0[r], sensitivity=names, **own)
        value, slope = al.gradient("error_rms", plant, laws[r], q0[r], names, **own)
        row = batch[r].sensitivity
        assert alone.sensitivity is not None and row is not None
        assert value == values[r]
        for name in names:
            np.testing.assert_array_equal(derivatives(row[name]), derivatives(alone.sensitivity[name]))
            np.testing.assert_array_equal(other.sensitivity[name].tau[r], row[name].tau)
            np.testing.assert_array_equal(slopes[name][r], slope[name])


def test_events_that_are_recorded_alone_change_nothing() -> None:
    options: dict[str, Any] = {"t_end": 0.1, "method": "dop853", "v0": V0, "sensitivity": "q0"}
    runs = [al.simulate(plant_of(""), LAWS["PDGravity"](), Q0, events=events, **options) for events in (None, al.Event.joint(0, 0.11))]
    assert runs[1].events is not None and len(runs[1].events) == 1
    first, second = (derivatives(run.sensitivity["q0"]) for run in runs if run.sensitivity is not None)
    np.testing.assert_array_equal(first, second)
