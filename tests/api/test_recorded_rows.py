"""Records that programs (compiled loops) store within their steps equal records that are taken one by one.

With `record_every` a program stores records within its steps. With `t_eval` at the same times each record is a separate evaluation.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_loop_metrics import CASES, PR, RIGID, SWING, TWO, start

import armlet as al

pytestmark = pytest.mark.filterwarnings("ignore:.*balance does not close:UserWarning")

ROWS = 11  # more than one group of SIMD lanes, the last one not full
SPAN: dict[str, Any] = {"t_end": 0.0605, "dt": 1e-3}  # the last step is a half step


def series(run: Any) -> dict[str, np.ndarray]:
    named = {name: getattr(run, name) for name in ("t", "q", "v", "tau", "estimate", "theta", "theta_dot")}
    return {name: values for name, values in named.items() if values is not None} | dict(run.monitors)


def bits(values: np.ndarray) -> np.ndarray:
    """The bits of numbers. Signs of zeros count; all NaNs are equal."""
    return np.where(np.isnan(values), np.nan, values).view(np.int64)


def require_same(one: Any, other: Any) -> None:
    first, second = series(one), series(other)
    assert list(first) == list(second)
    for name, values in first.items():
        np.testing.assert_array_equal(bits(values), bits(second[name]), err_msg=name)
    np.testing.assert_array_equal(one.status, other.status)
    np.testing.assert_array_equal(one.ended, other.ended) if hasattr(one, "ended") else None


def starts(plant: al.Plant) -> np.ndarray:
    return np.linspace(0.1, 0.3, ROWS * plant.arm.n).reshape(ROWS, plant.arm.n)


def has_equal_steps(case: str) -> bool:
    """Whether the runs of a case have explicit steps of equal size. Only such runs store records within programs."""
    _, _, options = CASES[case]()
    return "method" not in options and options.get("dt", 1e-3) is not None


@pytest.mark.parametrize("every", [1, 7])
@pytest.mark.parametrize("case", [case for case in CASES if has_equal_steps(case)])
def test_records_of_a_batch_are_those_taken_one_by_one(case: str, every: int) -> None:
    plant, law, options = CASES[case]()
    options = {name: value for name, value in (SPAN | options).items() if name not in ("t_eval", "record_every")}
    options["check_limits"] = False  # the case "limits" starts outside of some limits
    q0 = start(plant) if isinstance(law, list) or "v0" in options else starts(plant)
    within = al.simulate_batch(plant, law, q0, **options, record_every=every)
    alone = al.simulate_batch(plant, law, q0, **options, t_eval=within.t)
    require_same(within, alone)
    for threads in (1, 3):
        require_same(within, al.simulate_batch(plant, law, q0, **options, record_every=every, threads=threads))


@pytest.mark.parametrize("every", [1, 7])
@pytest.mark.parametrize("monitors", [True, False])
@pytest.mark.parametrize("extra", [{}, {"sample_time": 4e-3}, {"method": "euler"}, {"method": "semi_implicit", "tau_max": 9.0}], ids=str)
def test_records_of_one_run_are_those_taken_one_by_one(extra: dict[str, Any], monitors: bool, every: int) -> None:
    for arm in (PR, TWO):
        law, options = al.Adaptive(arm, SWING, 60.0, 12.0, 0.3), {"t_end": 0.3, "dt": 1e-3, "monitors": monitors} | extra
        within = al.simulate(al.RigidArm(arm), law, [0.1, 0.2], **options, record_every=every)
        assert within.stats["engine"] == al.build_info()["programs"]
        require_same(within, al.simulate(al.RigidArm(arm), law, [0.1, 0.2], **options, t_eval=within.t))


def test_jumps_of_force_and_motion_are_records_of_what_follows() -> None:
    motion = al.Quintic([0.1, 0.2], [0.5, 0.4], 0.0205)
    law, force = al.ComputedTorque(TWO, motion, 200.0, 30.0), [(0.01, [3.0, 1.0, 0.0]), (0.0333, [0.0, 0.0, 0.0])]
    options: dict[str, Any] = {"t_end": 0.06, "dt": 1e-3, "force": force, "force_frame": "link2"}
    within = al.simulate_batch(RIGID, law, starts(RIGID), **options)
    require_same(within, al.simulate_batch(RIGID, law, starts(RIGID), **options, t_eval=within.t))


@pytest.mark.parametrize("monitors", [True, False])
@pytest.mark.parametrize("every", [1, 5])
def test_rows_are_nan_from_a_fault_on(every: int, monitors: bool) -> None:
    """One row exceeds the state limit, one overflows, and two are too stiff for the step. The other rows continue."""
    gains = [100.0, 100.0, 100.0, 4e7, 100.0, 100.0, 1e300, 100.0, 100.0, 100.0, 4e7]
    laws = [al.PDGravity(TWO, [0.3, 0.2], gain, 20.0) for gain in gains]
    q0 = starts(RIGID)
    q0[1] = 900.0
    options: dict[str, Any] = {"t_end": 0.1, "dt": 1e-3, "state_limit": 1e3, "monitors": monitors}
    within = al.simulate_batch(RIGID, laws, q0, **options, record_every=every)
    require_same(within, al.simulate_batch(RIGID, laws, q0, **options, t_eval=within.t))
    assert set(np.flatnonzero(within.status != al.Status.SUCCESS)) == {1, 3, 6, 10}
    for row in (1, 3, 6, 10):
        ended = np.isnan(within.q[row, :, 0])
        assert ended.any() and np.all(ended[int(np.argmax(ended)) :]), row
    assert np.isfinite(within.q[within.status == al.Status.SUCCESS]).all()
    for row in (3, 6):
        within = al.simulate(RIGID, laws[row], q0[row], **options, record_every=every, throw=False)
        require_same(within, al.simulate(RIGID, laws[row], q0[row], **options, t_eval=np.arange(0, 101, every) * 1e-3, throw=False))


def test_a_run_that_leaves_the_range_of_the_sines_is_written_again() -> None:
    laws = [al.PDGravity(TWO, [target, 0.0], 50.0, 20.0) for target in (0.3, 1e6 + 3.0, 0.2)]
    q0 = [[0.0, 0.1], [1e6 + 3.0, 0.1], [0.2, 0.1]]
    options: dict[str, Any] = {"t_end": 0.06, "dt": 1e-3, "state_limit": 1e12}
    within = al.simulate_batch(RIGID, laws, q0, **options)
    require_same(within, al.simulate_batch(RIGID, laws, q0, **options, t_eval=within.t))


def test_a_run_without_steps_has_one_record() -> None:
    law = al.PDGravity(TWO, [0.3, 0.2], 50.0, 20.0)
    batch = al.simulate_batch(RIGID, law, starts(RIGID), t_end=0.0, dt=1e-3)
    assert batch.q.shape == (ROWS, 1, 2)
    np.testing.assert_array_equal(batch.q[:, 0], starts(RIGID))
    np.testing.assert_array_equal(batch.monitors["energy_balance"], np.zeros((ROWS, 1)))
