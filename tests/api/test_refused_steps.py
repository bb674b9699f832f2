"""Refused steps and samples: the state is unchanged, arrays are copies, and the applied input is reported."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.THREE_LINKS
Q0 = [0.1, 0.2, 0.3]
METHODS = ["rk4", "euler", "semi_implicit", "ros2"]
back = pytest.mark.parametrize(
    "back", [lambda x: pickle.loads(pickle.dumps(x)), copy.copy, copy.deepcopy], ids=["pickle", "copy", "deepcopy"]
)


def loose(law: al.Law | None = None, **options: Any) -> al.Simulator:
    return al.Simulator(al.RigidArm(ARM), law, Q0, dt=1e-3, **options)


@pytest.mark.parametrize("method", METHODS)
def test_the_input_is_the_one_that_acted(method: str) -> None:
    """An input argument beyond `tau_max` is clipped, and `tau` has the clipped value."""
    limited, free = loose(tau_max=[1.5, 1.5, 0.5], method=method), loose(method=method)
    limited.step([1.0, -2.0, 3.0])
    free.step([1.0, -1.5, 0.5])
    for sim in (limited, free):
        assert sim.tau.tolist() == sim.state["tau"].tolist() == [1.0, -1.5, 0.5]
    np.testing.assert_array_equal(np.concatenate([limited.q, limited.v]), np.concatenate([free.q, free.v]))
    other = copy.copy(limited)
    assert other.tau.tolist() == [1.0, -1.5, 0.5]


@pytest.mark.parametrize("method", METHODS)
def test_a_refused_step_changes_nothing(method: str) -> None:
    sim = loose(method=method)
    sim.step([1.0, 2.0, 3.0])
    before = sim.state
    for tau in ([1e10] * 3, [0.0] * 3):
        with pytest.raises(al.SolveError) as caught:
            sim.step(tau)
        for state in (sim.state, caught.value.partial):
            assert state.keys() == before.keys()
            for name, value in before.items():
                np.testing.assert_array_equal(state[name], value)
    assert sim.tau.tolist() == [1.0, 2.0, 3.0]


def test_a_refused_velocity_changes_nothing() -> None:
    """In a velocity-controlled plant, the velocity is the input. A refused step does not change it."""
    sim = al.Simulator(al.VelocityArm(ARM), None, Q0, dt=1e-3, state_limit=2.0)
    sim.step([0.1, 0.2, 0.3])
    q = sim.q.copy()
    with pytest.raises(al.SolveError, match=r"before it: v\[2\] = 0\.3"):
        sim.step([1e8] * 3)
    assert sim.tau.tolist() == sim.v.tolist() == [0.1, 0.2, 0.3] and sim.q.tolist() == q.tolist()


def test_a_refused_input_does_not_replace_the_last_one() -> None:
    """Between two samples the last input of the law stays. A refused input does not replace it."""
    law = al.PDGravity(ARM, [0.0, 0.0, 0.0], 20.0, 5.0)
    sim, other = loose(law, sample_time=4e-3), loose(law, sample_time=4e-3)
    for each in (sim, other):
        each.step()
    with pytest.raises(al.SolveError):
        sim.step([1e10] * 3)
    for each in (sim, other):
        each.set_state(other.q.copy(), other.v.copy())
        each.step()
    for name, value in other.state.items():
        np.testing.assert_array_equal(sim.state[name], value)


@back
def test_a_copy_has_diverged_too(back: Any) -> None:
    sim = loose()
    sim.step([1.0, 2.0, 3.0])
    assert back(sim).status is al.Status.SUCCESS
    with pytest.raises(al.SolveError):
        sim.step([1e10] * 3)
    other = back(back(sim))
    assert other.status is sim.status is al.Status.DIVERGED
    for name, value in sim.state.items():
        np.testing.assert_array_equal(other.state[name], value)
    with pytest.raises(al.SolveError):
        other.step([0.0] * 3)
    for each in (sim, other):
        each.set_state(Q0, [0.0] * 3)
        assert each.status is al.Status.SUCCESS
        each.step([0.0] * 3)
    np.testing.assert_array_equal(other.q, sim.q)
    assert back(other).status is al.Status.SUCCESS


def test_pickles_without_a_status_load() -> None:
    """Older pickles have no status."""
    sim = loose()
    sim.step([1.0, 2.0, 3.0])
    at = (1, np.concatenate([sim.q, sim.v]).tolist(), sim.tau.tolist())
    other = al._core._restore_simulator((al.RigidArm(ARM), None, Q0, {"dt": 1e-3}), at)
    assert other.status is al.Status.SUCCESS and other.q.tolist() == sim.q.tolist()
