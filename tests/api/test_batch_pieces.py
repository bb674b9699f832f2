"""Batches in pieces: warnings and errors are those of the whole batch, and invalid arguments are refused before the first piece."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
from refusals import refused

import armlet as al
from armlet.run import batches

# With `out` or PIECE = 1 the pieces have 64 runs, so 150 runs are the rows 0..63, 64..127 and 128..149.
ROWS = 150
ARM = models.TWO_LINKS
PLANT = al.RigidArm(ARM)
LAW = al.PDGravity(ARM, [0.1, 0.2], kp=20.0, kd=5.0)
Q0 = np.random.default_rng(0).uniform(-0.2, 0.2, (ROWS, 2))
NAN = Q0.copy()
NAN[100, 1] = np.nan
SHORT: dict[str, Any] = {"t_end": 0.02, "dt": 1e-3}
STEPS = [(0.0, [1.0, 0.0, 0.0]), (0.01, [0.0, 0.0, 0.0])]


def replaced(many: Any, one: Any, rows: tuple[int, ...] = (100,)) -> list[Any]:
    return [one if i in rows else many for i in range(ROWS)]


def told(call: Callable[[], al.BatchRun]) -> tuple[al.BatchRun, list[str]]:
    """The batch, and the texts of its warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        batch = call()
    assert all(each.filename == __file__ for each in caught)
    return batch, [str(each.message) for each in caught]


def coarse(**keywords: Any) -> al.BatchRun:
    """A batch whose steps are too coarse for the rows 100..149. Some of these runs diverge."""
    arm = models.PR
    motion = al.Quintic([0.0, 0.0], [1.0, 1.5], duration=3.0)
    laws = [al.Adaptive(arm, motion, kp=40.0, kd=20.0 if i < 100 else 100.0, gamma=5.0) for i in range(ROWS)]
    return al.simulate_batch(al.RigidArm(arm), laws, Q0, t_end=0.5, dt=1e-2, **keywords)


@pytest.mark.parametrize("keep", ["all", "metrics"])
def test_one_warning_per_balance_counts_all_rows(keep: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    whole, wanted = told(lambda: coarse(keep=keep))
    assert len(wanted) == 2
    assert all("of 150 runs (first bad index 100)" in text for text in wanted), wanted
    failed = whole.status == al.Status.DIVERGED
    assert failed.any() and not failed[:100].any() and not failed.all()
    status = np.zeros(ROWS, dtype=np.int64)
    monkeypatch.setattr(batches, "PIECE", 1)
    for more in ({"out": {"status": status}}, {"progress": lambda done, runs: None}):
        pieces, texts = told(lambda more=more: coarse(keep=keep, **more))  # type: ignore[misc]
        assert texts == wanted
        np.testing.assert_array_equal(pieces.status, whole.status)
        np.testing.assert_array_equal(pieces.q, whole.q)
    np.testing.assert_array_equal(status, whole.status)
    # A reference with one row per record requires pieces.
    reference = np.zeros((51, 2))
    _, texts = told(lambda: coarse(keep="metrics", metrics={"reference": reference}))
    assert texts == wanted


def test_a_warning_raised_as_an_error_comes_after_the_last_piece() -> None:
    q, seen = np.zeros((ROWS, 51, 2)), []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(UserWarning, match=r"of 150 runs \(first bad index 100\)"):
            coarse(out={"q": q}, progress=lambda done, runs: seen.append(done))
    assert seen == [64, 128, 150]
    assert np.isfinite(q[:100]).all()


def test_one_warning_of_joint_limits_counts_all_rows() -> None:
    joint = {"type": "R", "axis": [0, 0, 1], "xyz": [0.5, 0, 0], "phi": [1, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1], "lower": -3.1, "upper": 3.1}
    arm = al.Arm.from_chain([joint, joint])
    q0 = Q0.copy()
    q0[100:, 0] = 4.0
    laws = [al.PDGravity(arm, [0.1, 0.2 if i < 130 else 5.0], kp=20.0, kd=5.0) for i in range(ROWS)]
    call: Callable[..., al.BatchRun] = lambda **more: al.simulate_batch(al.RigidArm(arm), laws, q0, **SHORT, **more)  # noqa: E731
    _, wanted = told(call)
    assert len(wanted) == 1 and "q0[100, 0] = 4 rad is outside [-3.1, 3.1] (50 of 150 rows)" in wanted[0]
    assert "(20 of 150 rows)" in wanted[0]
    _, texts = told(lambda: call(out={}))
    assert texts == wanted


def sampled(period: float, joint_stiffness: Any, **more: Any) -> al.BatchRun:
    plants = [al.ElasticArm(ARM, stiffness, 0.4) for stiffness in joint_stiffness]
    laws = [al.JointImpedance(ARM, [0.1, 0.2], 10.0, 1.0, stiffness, 0.4, 0.01) for stiffness in joint_stiffness]
    return al.simulate_batch(plants, laws, Q0, t_end=6 * period, dt=period / 2, sample_time=period, **more)


def test_one_warning_of_the_sample_time() -> None:
    _, wanted = told(lambda: sampled(2e-3, [800.0] * ROWS))
    assert len(wanted) == 1 and "sample_time 0.002 s is above a third" in wanted[0]
    _, texts = told(lambda: sampled(2e-3, [800.0] * ROWS, out={}))
    assert texts == wanted


SMALL = al.planar_arm([0.5])
OTHER = al.PID(ARM, [0.1, 0.2], 20.0, 1.0, 5.0)
LUGRE = al.LuGre(coulomb=2.0, static=3.0, stribeck_speed=0.05, stiffness=200.0, damping=2.0, viscous=0.5)
REFUSED: dict[str, tuple[str, Callable[..., al.BatchRun]]] = {
    "start": ("q0 is not finite", lambda **k: al.simulate_batch(PLANT, LAW, NAN, **SHORT, **k)),
    "velocity": ("v0 is not finite", lambda **k: al.simulate_batch(PLANT, LAW, Q0, v0=NAN, **SHORT, **k)),
    "motors": (
        "theta0 is not finite",
        lambda **k: al.simulate_batch(
            al.ElasticArm(ARM, 800.0, 0.4), al.MotorPD(ARM, [0.1, 0.2], 10.0, 1.0, joint_stiffness=800.0), Q0, theta0=NAN, **SHORT, **k
        ),
    ),
    "law": ("law mixes kinds", lambda **k: al.simulate_batch(PLANT, replaced(LAW, OTHER), Q0, **SHORT, **k)),
    # Each piece has only one kind of law, and the second and the third piece have another one than the first.
    "laws of a piece": (
        "law mixes kinds",
        lambda **k: al.simulate_batch(PLANT, replaced(LAW, OTHER, tuple(range(64, ROWS))), Q0, **SHORT, **k),
    ),
    "plant": (
        "plant has the wrong number of joints",
        lambda **k: al.simulate_batch(replaced(PLANT, al.RigidArm(SMALL)), LAW, Q0, **SHORT, **k),
    ),
    "friction": (
        "plant mixes models of friction",
        lambda **k: al.simulate_batch(replaced(PLANT, al.RigidArm(ARM, friction=LUGRE)), LAW, Q0, **SHORT, **k),
    ),
    "motor loop": (
        "sample_time is too large for the motor loop",
        lambda **k: sampled(1e-3, replaced(800.0, 80000.0), **k),
    ),
    "not a law": ("law is of the wrong type", lambda **k: al.simulate_batch(PLANT, replaced(LAW, 1.0), Q0, **SHORT, **k)),
    "force": (
        "force is not in order of time",
        lambda **k: al.simulate_batch(PLANT, LAW, Q0, force=replaced(STEPS, STEPS[::-1]), force_frame="link2", **SHORT, **k),
    ),
    "forces": (
        "force has the wrong number of entries",
        lambda **k: al.simulate_batch(PLANT, LAW, Q0, force=[STEPS] * (ROWS + 1), force_frame="link2", **SHORT, **k),
    ),
    "laws": ("law has the wrong number of entries", lambda **k: al.simulate_batch(PLANT, [LAW] * 149, Q0, **SHORT, **k)),
    "no law": ("law is empty", lambda **k: al.simulate_batch(PLANT, [], Q0, **SHORT, **k)),
    "velocities": ("v0 has the wrong shape", lambda **k: al.simulate_batch(PLANT, LAW, Q0, v0=Q0[:149], **SHORT, **k)),
    "one velocity": ("v0 has the wrong shape", lambda **k: al.simulate_batch(PLANT, LAW, Q0, v0=Q0[0], **SHORT, **k)),
}
# Errors without an index, or with another one than 100.
WHOLE = ("laws of a piece", "force", "forces", "laws", "no law", "velocities", "one velocity")


@pytest.mark.parametrize("name", REFUSED)
def test_errors_name_the_row_of_the_batch_before_the_first_piece(name: str) -> None:
    words, call = REFUSED[name]
    with pytest.raises(al.InputError, match=words) as whole:
        call()
    assert name in WHOLE or "first bad index 100" in str(whole.value).replace("(100, 1)", "100")
    seen: list[int] = []
    with pytest.raises(al.InputError) as pieces:
        call(out={}, progress=lambda done, runs: seen.append(done))
    assert str(pieces.value) == str(whole.value)
    assert not seen


def test_a_frame_that_one_row_lacks_is_refused_before_the_first_piece() -> None:
    seen: list[int] = []
    plants = replaced(al.RigidArm(ARM.with_frame("tool", "link2")), PLANT)
    measures: dict[str, Any] = {
        "keep": "metrics",
        "metrics": {"frame": "tool"},
        "out": {},
        "progress": lambda done, runs: seen.append(done),
    }
    refused(lambda: al.simulate_batch(plants, LAW, Q0, **measures, **SHORT), "simulate_batch: frame", "tool")
    assert not seen


def test_the_shape_of_a_reference_is_that_of_the_batch() -> None:
    for shape in ((149, 21, 2), (150, 4, 2), (4, 2)):
        with pytest.raises(al.InputError) as caught:
            al.simulate_batch(PLANT, LAW, Q0, keep="metrics", metrics={"reference": np.zeros(shape)}, out={}, **SHORT)
        assert str(caught.value).endswith(f"expected (2,), (21, 2) or (150, 21, 2), got {shape}")


def test_every_row_runs_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The check of the whole batch has no step."""
    steps, run = np.zeros(ROWS), batches._core.simulate_batch
    first = {tuple(row): i for i, row in enumerate(Q0)}

    def counted(plant: Any, law: Any, q0: Any, keywords: dict[str, Any]) -> dict[str, Any]:
        for row in q0:
            steps[first[tuple(row)]] += keywords["t_end"] / keywords["dt"]
        return run(plant, law, q0, keywords)

    monkeypatch.setattr(batches._core, "simulate_batch", counted)
    al.simulate_batch(PLANT, LAW, Q0, out={}, **SHORT)
    np.testing.assert_array_equal(steps, 20.0)
