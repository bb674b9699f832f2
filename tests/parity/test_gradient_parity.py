"""Derivatives of armlet's runs against differences of runs of `armlet.reference`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from loops import pair
from numpy.typing import NDArray

import armlet as al
from armlet import reference

Array = NDArray[np.float64]

START, END = np.array([0.2, -0.1]), np.array([0.5, 0.3])
# The reference takes differences of fourth order. They divide the rounding errors of the runs by their step.
CLOSE = 1e-7
OPTIONS: dict[str, Any] = {"t_end": 0.03, "dt": 2e-3, "v0": [0.3, -0.2]}


def made(side: Any, arm: Any, name: str, numbers: dict[str, Any]) -> Any:
    """Return a law from `side`, which is armlet or the reference."""
    motion = side.Quintic(START, END, 0.2)
    gains = {"kp": np.array([9.0, 7.0]), "kd": np.array([2.5, 3.0])} | numbers
    if name == "Adaptive":
        estimate = gains.pop("estimate", 0.1 * np.ones(20))
        return side.Adaptive(arm, motion, gains["kp"], gains["kd"], gains.pop("gamma", np.full(20, 0.3)), estimate=estimate)
    if name == "ComputedTorque":
        return side.ComputedTorque(arm, motion, gains["kp"], gains["kd"])
    if name == "PID":
        return side.PID(arm, END, gains["kp"], np.array([3.0, 4.0]), gains["kd"])
    return side.PDGravity(arm, numbers.get("target", END), gains["kp"], gains["kd"])


CASES = [
    ("Adaptive", "kp", [9.0, 7.0]),
    ("Adaptive", "kd", [2.5, 3.0]),
    ("Adaptive", "gamma", np.linspace(0.2, 0.5, 20)),
    ("Adaptive", "estimate", np.linspace(0.1, 0.3, 20)),
    ("ComputedTorque", "kp", [9.0, 7.0]),
    ("PDGravity", "kd", [2.5, 3.0]),
    ("PDGravity", "target", [0.5, 0.3]),
    ("PID", "kp", [9.0, 7.0]),
]


@pytest.mark.slow
@pytest.mark.parametrize("sample_time", [None, 6e-3], ids=["continuous", "sampled"])
@pytest.mark.parametrize(("law", "name", "value"), CASES, ids=[f"{law}.{name}" for law, name, _ in CASES])
def test_sensitivities(law: str, name: str, value: Any, sample_time: float | None) -> None:
    ours, theirs = pair(np.random.default_rng(3), 2)
    options = OPTIONS | {"sample_time": sample_time}
    q0 = np.array([0.1, 0.05])
    run = al.simulate(al.RigidArm(ours), made(al, ours, law, {name: np.array(value)}), q0, sensitivity=[f"law.{name}", "q0"], **options)
    assert run.sensitivity is not None

    def records(number: Array, start: Array) -> Array:
        found = reference.simulate(reference.RigidArm(theirs), made(reference, theirs, law, {name: number}), start, **options)
        return np.concatenate([found["q"], found["v"], found["tau"]], axis=-1)

    for of, varied, at in (
        (f"law.{name}", lambda number: records(number, q0), value),
        ("q0", lambda start: records(np.array(value), start), q0),
    ):
        expected = reference.sensitivity(varied, at)
        one: al.Sensitivity = run.sensitivity[of]
        got = np.concatenate([one.q, one.v, one.tau], axis=1)
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=CLOSE * np.abs(expected).max())


def test_drives() -> None:
    """Derivatives with respect to armature, damping and Coulomb friction of the plant. No joint reverses its direction in this run."""
    ours, theirs = pair(np.random.default_rng(3), 2)
    drives = {"damping": np.array([0.4, 0.3]), "friction": np.array([0.2, 0.1]), "armature": np.array([0.05, 0.02])}
    plant, law = al.RigidArm(ours.with_drives(**drives), friction=True), made(al, ours, "PDGravity", {})
    options = OPTIONS | {"v0": [0.8, 0.6]}
    run = al.simulate(plant, law, [0.1, 0.05], sensitivity=[f"arm.{name}" for name in drives], **options)
    assert run.sensitivity is not None and np.all(run.v > 0.0)
    for name, value in drives.items():

        def records(number: Array, name: str = name) -> Array:
            plant = reference.RigidArm(theirs.with_drives(**(drives | {name: number})), friction=True)
            found = reference.simulate(plant, made(reference, theirs, "PDGravity", {}), [0.1, 0.05], **options)
            return np.concatenate([found["q"], found["v"], found["tau"]], axis=-1)

        expected, one = reference.sensitivity(records, value), run.sensitivity[f"arm.{name}"]
        got = np.concatenate([one.q, one.v, one.tau], axis=1)
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=CLOSE * np.abs(expected).max())


def test_rows() -> None:
    ours, theirs = pair(np.random.default_rng(4), 2)
    q0, kp = np.array([[0.1, 0.05], [0.3, -0.2]]), np.array([9.0, 7.0])
    batch = al.simulate_batch(
        al.RigidArm(ours),
        made(al, ours, "PDGravity", {"kp": kp}),
        q0,
        sensitivity="law.kp",
        **(OPTIONS | {"v0": np.tile(OPTIONS["v0"], (2, 1))}),
    )
    assert batch.sensitivity is not None
    for r, start in enumerate(q0):

        def positions(number: Array, start: Array = start) -> Array:
            law = made(reference, theirs, "PDGravity", {"kp": number})
            return np.asarray(reference.simulate(reference.RigidArm(theirs), law, start, **OPTIONS)["q"])

        expected = reference.sensitivity(positions, kp)
        np.testing.assert_allclose(batch.sensitivity["law.kp"].q[r], expected, rtol=0.0, atol=CLOSE * np.abs(expected).max())


def test_gradient() -> None:
    ours, theirs = pair(np.random.default_rng(4), 2)
    kp = np.array([9.0, 7.0])

    def loss(number: Array) -> float:
        law = made(reference, theirs, "PDGravity", {"kp": number})
        found = reference.simulate(reference.RigidArm(theirs), law, [0.1, 0.05], **OPTIONS)
        return float((found["q"] ** 2).sum() + 1e-3 * (found["tau"] ** 2).sum())

    def ours_with_slopes(run: Any) -> Any:
        return (run.q**2).sum() + 1e-3 * (run.tau**2).sum(), {"q": 2.0 * run.q, "tau": 2e-3 * run.tau}

    law, names = made(al, ours, "PDGravity", {"kp": kp}), ["law.kp"]
    value, slopes = al.gradient(ours_with_slopes, al.RigidArm(ours), law=law, q0=[0.1, 0.05], names=names, memory=1 << 12, **OPTIONS)
    expected = reference.gradient(loss, kp)
    assert value == pytest.approx(loss(kp), rel=1e-10)
    np.testing.assert_allclose(slopes["law.kp"], expected, rtol=0.0, atol=CLOSE * np.abs(expected).max())
