"""An exception of the caller's function ends the run. It is raised quickly and unchanged, and no function is called again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import pytest

import armlet as al

ARM = models.TWO_LINKS
PLANT = al.RigidArm(ARM)


@pytest.mark.parametrize(
    "clock",
    [
        {"dt": 1e-3, "sample_time": 1e-3},
        {"dt": 1e-3, "sample_time": al.Sampling(1e-3, delay=1e-3)},
        {"method": "dopri5", "sample_time": 1e-3},
    ],
    ids=["fixed", "delayed", "adaptive"],
)
def test_a_law_that_raises_is_not_called_again(clock: dict[str, Any]) -> None:
    calls = 0

    def law(t: float, q: Any, v: Any) -> list[float]:
        nonlocal calls
        calls += 1
        if t > 0.5:
            raise ZeroDivisionError("law")
        return [0.0, 0.0]

    with pytest.raises(ZeroDivisionError, match="law") as caught:
        al.simulate(PLANT, law, [0.0, 0.0], t_end=1e3, **clock)
    assert caught.traceback[-1].name == "law"
    # The law is called at 501 samples up to 0.5 s, and in the call that raises. An adaptive run may evaluate a sample twice.
    assert 502 <= calls <= 504


@pytest.mark.parametrize("method", [{"dt": 1e-3}, {"method": "dopri5"}], ids=["fixed", "adaptive"])
def test_a_force_that_raises_is_not_called_again(method: dict[str, Any]) -> None:
    after = 0

    def force(t: float) -> list[float]:
        nonlocal after
        after += t > 0.5
        if t > 0.5:
            raise ZeroDivisionError("force")
        return [0.0, 0.0, 0.0]

    law = al.PDGravity(ARM, [0.1, 0.2], kp=10.0, kd=3.0)
    with pytest.raises(ZeroDivisionError, match="force"):
        al.simulate(PLANT, law, [0.0, 0.0], t_end=1e5, force=force, force_frame="link2", **method)
    assert after == 1


LONG = """
import signal, time
import numpy as np
import armlet as al
when = []
def stamp(number, frame):
    when.append(time.perf_counter())
    signal.default_int_handler(number, frame)
signal.signal(signal.SIGINT, stamp)
arm = al.load_urdf(al.example_urdf("seven_axis"))
pendulum = al.pendulum(1.0, 5.0)
plant, law = al.RigidArm(pendulum), al.PDGravity(pendulum, [1.0], kp=3.0, kd=1.0)
rng = np.random.default_rng(1)
record = rng.normal(size=(4, 200000, arm.n))
print("ready", flush=True)
try:
    while True:
        {call}
except KeyboardInterrupt:
    print("interrupted", time.perf_counter() - when[0], signal.getsignal(signal.SIGINT) is stamp, flush=True)
"""
CALLS = {
    "a law in Python": "al.simulate(plant, lambda t, q, v: [0.0], [0.0], t_end=1e6, dt=1e-3, sample_time=1e-3, record_every=10**6)",
    "time_path": "al.time_path(arm, rng.normal(size=(2500, 7)), tau_max=1e4, v_max=2.0, grid=40000)",
    "inverse_kinematics": (
        "al.inverse_kinematics(arm, [al.Task(arm.frame_names[-1], 'xyz', [9.0, 0.0, 0.0])], np.zeros(arm.n), restarts=10**7)"
    ),
    "identify": "arm.identify(*record)",
    "batch that begins": "al.simulate_batch(plant, law, np.zeros((200000, 1)), t_end=1e-3, dt=1e-3, keep='final')",
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS.keys())
def test_ctrl_c(call: str, interrupted: Callable[[str], tuple[list[str], float]]) -> None:
    """The goal is 100 ms. The limit of 1 s is a margin for a busy machine."""
    words, _ = interrupted(LONG.replace("{call}", call))
    assert words and words[0] == "interrupted", words
    assert float(words[1]) <= 1.0
    assert words[2] == "True"
