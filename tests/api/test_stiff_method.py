"""`method="stiff"` selects an implicit method: `rodas4` for sampled controllers, otherwise `radau5`."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.TWO_HEAVY_LINKS
PLANT, LAW = al.RigidArm(ARM), al.PDGravity(ARM, [0.3, 0.6], kp=100.0, kd=10.0)
GIVEN: dict[str, Any] = {"t_end": 0.2, "rtol": 1e-6, "atol": 1e-9, "t_eval": [0.1, 0.2]}


def states(method: str, **more: Any) -> bytes:
    run = al.simulate(PLANT, LAW, [0.1, -0.2], method=method, **GIVEN, **more)
    return run.q.tobytes() + run.v.tobytes()


def test_a_continuous_loop_has_the_bits_of_radau5() -> None:
    assert states("stiff") == states("radau5") != states("rodas4")


@pytest.mark.parametrize("sample_time", [0.01, al.Sampling(0.01, delay=0.002)])
def test_a_sampled_loop_has_the_bits_of_rodas4(sample_time: Any) -> None:
    stiff, rodas4, radau5 = (states(method, sample_time=sample_time) for method in ("stiff", "rodas4", "radau5"))
    assert stiff == rodas4 != radau5


def test_batches_and_functions_use_the_same_rule() -> None:
    batches = [al.simulate_batch(PLANT, LAW, np.zeros((3, 2)), method=method, **GIVEN).q for method in ("stiff", "radau5")]
    assert np.array_equal(*batches)
    runs = [al.integrate(lambda t, y: [-1e6 * (y[0] - np.cos(t))], (0.0, 1.0), [0.0], method=method) for method in ("stiff", "radau5")]
    assert np.array_equal(runs[0].y, runs[1].y) and abs(runs[0].y[-1, 0] - np.cos(1.0)) < 1e-5


@pytest.mark.parametrize(
    ("run", "message"),
    [
        (lambda: al.simulate(PLANT, LAW, [0.0, 0.0], t_end=1.0, method="Stiff"), "expected one of euler, .*, rodas4, stiff, got Stiff"),
        (lambda: al.simulate(PLANT, LAW, [0.0, 0.0], t_end=1.0, method="stiff", dt=0.1), "dt is not used: expected None for radau5"),
        (lambda: al.Simulator(PLANT, LAW, [0.0, 0.0], dt=0.1, method="stiff"), "method chooses its own steps"),
        (lambda: al.integrate(lambda t, y: y, (0.0, 1.0), [1.0], method="stiff", dt=0.1), "dt is given"),
        (lambda: al.scipy_method("stiff"), "expected one of dopri5, dop853, radau5, rodas4"),
    ],
)
def test_bad_input_is_refused(run: Any, message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        run()
