"""An argument of absurd size quickly raises an error that names it. No memory is allocated, and the process does not end."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.PENDULUM
PLANT = al.RigidArm(ARM)
LAW = al.PDGravity(ARM, [1.0], kp=3.0, kd=1.0)
MANY = np.broadcast_to(np.zeros(1), (10**15, 1))


def run(**options: Any) -> al.Run:
    return al.simulate(PLANT, LAW, [0.0], t_end=0.1, **options)


def solve(**options: Any) -> al.Integration:
    return al.integrate(lambda t, y: -np.asarray(y), (0.0, 1.0), **options)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: run(dt=1e-3, sample_time=al.Sampling(1e-3, sensor_delay=10**12)), al.InputError, "^simulate: sensor_delay is too long"),
        (lambda: run(dt=1e-3, sample_time=al.Sampling(1e-3, delay=1e9)), al.InputError, "^simulate: delay is too long"),
        (lambda: run(method="dopri5", sample_time=al.Sampling(1e-3, delay=1e9)), al.InputError, "^simulate: delay is too long"),
        (lambda: run(method="dopri5", sample_time=1e-300), al.InputError, "^simulate: sample_time is too small"),
        (
            lambda: run(method="dopri5", sample_time=al.Sampling(1e-300, jitter=1e-301)),
            al.InputError,
            "^simulate: sample_time is too small",
        ),
        (lambda: run(method="dopri5", sample_time=al.Sampling(1e-12, jitter=1e-13)), MemoryError, "^simulate: "),
        (
            lambda: al.Simulator(PLANT, LAW, [0.0], dt=1e-3, sample_time=al.Sampling(1e-3, sensor_delay=10**12)),
            al.InputError,
            "sensor_delay",
        ),
        (lambda: solve(y0=[1.0], method="rk4", dt=1e-300), al.InputError, "^integrate: dt is too small"),
        (lambda: solve(y0=np.broadcast_to(0.0, (3 * 10**6,)), method="rodas4"), MemoryError, "^integrate: "),
        (lambda: solve(y0=np.broadcast_to(0.0, (3 * 10**6,)), method="radau5"), MemoryError, "^integrate: "),
        (lambda: al.time_path(models.PR, lambda s: [s, s], tau_max=9.0, samples=10**12), al.InputError, "samples is out"),
        (lambda: al.simulate_batch(PLANT, LAW, MANY, t_end=0.1, dt=1e-3, keep="metrics"), MemoryError, "^simulate_batch: "),
        (lambda: al.simulate_batch(PLANT, LAW, MANY, t_end=0.1, dt=1e-3, keep="final", progress=print), MemoryError, "^simulate_batch: "),
    ],
)
def test_absurd_sizes(call: Callable[[], object], error: type[Exception], message: str) -> None:
    start = time.perf_counter()
    with pytest.raises(error, match=message):
        call()
    # A generous limit for a busy machine.
    assert time.perf_counter() - start < 5.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "dopri5", "dt": np.nan}, "dt is not used"),
        ({"method": "dopri5", "dt": 0.0}, "dt is not used"),
        ({"dt": 1e-3, "rtol": np.nan}, "rtol is not used"),
        ({"dt": 1e-3, "atol": -1.0}, "atol is not used"),
    ],
)
def test_unused_arguments_of_a_method_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(al.InputError, match=f"^simulate: {message}"):
        run(**options)
