"""If the input of a law overflows, a call raises, and a run ends with a status and an error that names the input."""

from __future__ import annotations

import numpy as np
import pytest

import armlet as al

TWO = al.planar_arm([1.0, 1.0])
PLANT = al.RigidArm(TWO)
FAR = [1e10, 1.0]
LAWS = {
    "PDGravity": al.PDGravity(TWO, FAR, 1e300, 20.0),
    "ComputedTorque": al.ComputedTorque(TWO, al.Hold(FAR), kp=1e300, kd=20.0),
    "CartesianImpedance": al.CartesianImpedance(TWO, [1e10, 0.0, 0.0], 1e300, 50.0, frame="link2"),
}


@pytest.mark.parametrize("name", LAWS)
def test_a_call_raises(name: str) -> None:
    law = LAWS[name]
    for q, v in (([0.1, 0.2], [0.0, 0.0]), (np.array([0.1, 0.2]), np.zeros(2))):
        with pytest.raises(al.InputError, match=rf"^{name}: t, q, v give an input that is not finite: .* \(first bad index 0\)$"):
            law(0.0, q, v)


@pytest.mark.parametrize("name", LAWS)
def test_a_run_ends_with_a_status(name: str) -> None:
    with pytest.raises(al.SolveError, match=r"diverged: .*; the input of the law is not finite .*: tau\[0\] = -?(inf|nan)$") as caught:
        al.simulate(PLANT, LAWS[name], [0.1, 0.2], t_end=0.1, dt=1e-3)
    assert caught.value.status is al.Status.DIVERGED
    batch = al.simulate_batch(PLANT, LAWS[name], [[0.1, 0.2]] * 3, t_end=0.1, dt=1e-3)
    assert [al.Status(status) for status in batch.status] == [al.Status.DIVERGED] * 3
    with pytest.raises(al.SolveError):
        al.Simulator(PLANT, LAWS[name], [0.1, 0.2], dt=1e-3).step()
