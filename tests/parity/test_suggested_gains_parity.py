"""Suggested gains against the reference, and in closed loops.

The reference finds the limit of the sampled loop from its spectral radius.
"""

from __future__ import annotations

import pickle
from typing import Any

import models
import numpy as np
import pytest
from trees import driven_tree

import armlet as al
from armlet import reference as ref


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.3, 1.0, 2.5])
@pytest.mark.parametrize("n", range(1, 9))
def test_suggested_gains(n: int, ratio: float) -> None:
    """Gains agree for random trees with revolute and prismatic joints, limits and armature."""
    arm, theirs = driven_tree(n, 3)
    got = al.suggest_gains(arm, 12.0, damping_ratio=ratio, sample_time=1e-5)
    want = ref.suggest_gains(theirs, 12.0, damping_ratio=ratio, sample_time=1e-5)
    assert isinstance(got, al.SuggestedGains)
    # The mass matrices agree to 1e-12 of their largest entry. Small eigenvalues of a badly scaled matrix have a larger relative error.
    for ours, other in ((got.kp, want.kp), (got.kd, want.kd), (got.inertia, want.inertia)):
        np.testing.assert_allclose(ours, other, rtol=1e-9)
    np.testing.assert_allclose([got.limit, got.computed_torque_limit], [want.limit, want.computed_torque_limit], rtol=1e-6)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["six_axis", "seven_axis", "planar_2r"])
def test_every_mode_is_fast_and_damped_enough(name: str) -> None:
    """The inertia of the gains bounds the mass matrix at other configurations, to 5 %.

    `suggest_gains` looks at 512 random configurations and may miss the worst one.
    """
    arm = al.load_urdf(al.example_urdf(name))
    g = al.suggest_gains(arm, 20.0)
    low, high = (np.where(np.isfinite(arm.limits[key]), arm.limits[key], side * np.pi) for key, side in (("q_min", -1), ("q_max", 1)))
    q = np.random.default_rng(5).uniform(low, high, (200, arm.n))
    values = np.linalg.eigvals(arm.mass_matrix(q) / g.inertia[:, None]).real
    assert values.max() <= 1.05 and values.min() >= 0.5 * g.lightest
    assert values.max() >= 0.5


@pytest.mark.parametrize("ratio", [0.2, 0.4, 1.0, 2.0])
@pytest.mark.parametrize("part", [0.97, 1.03])
def test_the_limit_of_the_sampled_loop(ratio: float, part: float) -> None:
    """A link without gravity is a double integrator. It settles with a bandwidth below the limit, and diverges above it."""
    arm = al.pendulum(2.0, 0.0)
    h = 1e-2
    limit = al.suggest_gains(arm, 1.0, ratio, h).computed_torque_limit
    assert limit is not None
    if part < 1.0:
        g = al.suggest_gains(arm, part * limit, ratio, h)
        kp, kd = g.kp, g.kd
    else:
        with pytest.raises(al.InputError, match=r"^suggest_gains: bandwidth is too large for the sample time: expected below"):
            al.suggest_gains(arm, part * limit, ratio, h)
        kp, kd = 2.0 * (part * limit) ** 2, 4.0 * ratio * part * limit
    run = al.simulate(al.RigidArm(arm), al.PDGravity(arm, [0.0], kp, kd), [1e-3], t_end=20.0, dt=h, sample_time=h, throw=False)
    settled = run.status is al.Status.SUCCESS and np.abs(run.q[-50:]).max() < 1e-4
    assert settled == (part < 1.0)


def test_text_and_attributes() -> None:
    arm = models.TWO_LINKS
    g = al.suggest_gains(arm, 20.0)
    assert g.limit is g.computed_torque_limit is g.sample_time is None
    assert g.computed_torque == (400.0, 40.0) and "PDGravity" in str(g) and "ComputedTorque" in str(g) and "held" not in str(g)
    again = al.suggest_gains(arm, 20.0)
    assert g.kp.tobytes() == again.kp.tobytes() and g.lightest == again.lightest
    other: Any = pickle.loads(pickle.dumps(g))
    assert str(other) == str(g) and repr(other) == "SuggestedGains(n=2, bandwidth=20, damping_ratio=1, sample_time=None)"
    with pytest.warns(UserWarning, match="suggest_gains: bandwidth is too large for gains that are torques at this sample time"):
        coarse = al.suggest_gains(arm, 20.0, sample_time=0.04)
    assert "UNSTABLE" in str(coarse) and "stable" in str(coarse)
    run = al.simulate(al.RigidArm(arm), al.PDGravity(arm, [0.5, 0.3], g.kp, g.kd), [0.0, 0.0], t_end=3.0, dt=1e-3)
    # The slowest mode decays at 10 rad/s or faster, by exp(-30) in 3 s.
    assert np.abs(run.q[-1] - [0.5, 0.3]).max() < 1e-6
    for kind in (models.PR, al.pendulum(1.0, 2.0)):
        assert al.suggest_gains(kind, 5.0).kp.shape == (kind.n,)


BAD: list[tuple[Any, str]] = [
    (lambda arm: al.suggest_gains(arm, 0.0), "bandwidth is not positive"),
    (lambda arm: al.suggest_gains(arm, np.nan), "bandwidth is not"),
    (lambda arm: al.suggest_gains(arm, [1.0]), "bandwidth is not"),
    (lambda arm: al.suggest_gains(arm, 1.0, -1.0), "damping_ratio is not positive"),
    (lambda arm: al.suggest_gains(arm, 1.0, sample_time=0.0), "sample_time is not positive"),
    (lambda arm: al.suggest_gains(arm, 1e200), "bandwidth makes gains that overflow"),
    (lambda arm: al.suggest_gains("arm", 1.0), "arm is of the wrong type"),
    (lambda arm: al.suggest_gains(arm.with_parameters(np.zeros(20)), 1.0), "arm has no inertia at a joint"),
]


@pytest.mark.parametrize(("call", "words"), BAD, ids=[words for _, words in BAD])
def test_bad_input(call: Any, words: str) -> None:
    with pytest.raises(al.InputError, match=f"^suggest_gains: {words}"):
        call(models.TWO_LINKS)
