"""Torque offsets in the regressor, in identification and in adaptation."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import armlet as al

Array = Any


def record(arm: al.Arm, samples: int = 1500) -> tuple[Array, Array, Array]:
    t = np.linspace(0.0, 20.0, samples)[:, None]
    w = np.linspace(0.9, 3.1, arm.n)
    return np.sin(w * t), w * np.cos(w * t), -w * w * np.sin(w * t)


def test_regressor_columns() -> None:
    arm = models.SIX_AXES
    q, v, v_r, a_r = np.random.default_rng(0).normal(size=(4, 3, 6))
    plain = arm.regressor(q, v, v_r, a_r, friction=True)
    full = arm.regressor(q, v, v_r, a_r, friction=True, offset=True)
    np.testing.assert_array_equal(full[..., :-6], plain)
    np.testing.assert_array_equal(full[..., -6:], np.broadcast_to(np.eye(6), (3, 6, 6)))
    assert arm.base_parameters(friction=True, offset=True).names[-6:] == tuple(f"offset[{name}]" for name in arm.joint_names)
    with pytest.raises(al.InputError, match="offset"):
        models.PR.regressor([0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], offset=True)


def test_offsets_of_a_record_are_found() -> None:
    """Without their columns, offsets of the torque sensors change the estimates of gravity. With them, both are right."""
    arm = models.SIX_AXES
    true = arm.with_drives(damping=[3.0, 3.0, 3.0, 1.0, 1.0, 1.0], friction=[4.0, 4.0, 4.0, 2.0, 2.0, 2.0])
    q, v, a = record(arm)
    offset = np.array([1.0, -0.8, 0.6, -0.5, 0.4, 0.3])
    tau = true.inverse_dynamics(q, v, a, friction=True) + offset + 0.05 * np.random.default_rng(5).normal(size=q.shape)
    noise = np.full(6, 0.05)
    found, biased = (arm.identify(q, v, a, tau, friction=True, noise=noise, offset=given) for given in (True, False))
    gravity = true.gravity(q[::50])
    assert np.abs(biased.arm.gravity(q[::50]) - gravity).max() > 0.5
    assert np.abs(found.arm.gravity(q[::50]) + found.offsets - gravity - offset).max() < 0.05
    np.testing.assert_allclose(found.offsets, offset, atol=0.05)
    np.testing.assert_allclose(found.arm.limits["friction"], true.limits["friction"], atol=0.02)
    np.testing.assert_allclose(found.residuals, noise, rtol=0.1)
    assert not biased.offsets.any() and (biased.residuals > 1.05 * noise).any()
    errors = found.values - found.base.projection @ np.concatenate(
        [true.parameters, *(true.limits[k] for k in ("damping", "friction")), offset]
    )
    assert np.mean(np.abs(errors) < 2.0 * found.deviations) > 0.85


def test_an_offset_beside_gravity_cannot_be_distinguished() -> None:
    """On a vertical rail the weight and the offset are one constant force, so they are one base parameter."""
    rail = al.Arm.from_chain([{"type": "P", "axis": [0, 0, 1], "phi": [2.0] + [0.0] * 9}])
    base = rail.base_parameters(offset=True)
    assert base.count == 2 and base.unseen == tuple(name for name in base.names if name not in ("m[joint1]", "offset[joint1]"))
    still = al.Arm.from_chain([{"type": "P", "axis": [0, 0, 1], "phi": [2.0] + [0.0] * 9}])
    q, v, a = np.zeros((50, 1)), np.full((50, 1), 0.1), np.zeros((50, 1))
    found = still.identify(q, v, a, np.full((50, 1), 9.81 * 2.0 + 1.0), offset=True)
    assert found.rank == 1 and len(found.unidentified) == 2


def test_adaptation_learns_a_constant_torque() -> None:
    """A constant force at the tip is a torque offset at rest. Without offsets, the tracking error remains."""
    arm = al.planar_arm([0.5, 0.4], gravity=(0.0, 0.0))
    law = al.Adaptive(arm, al.Hold([0.3, 0.5]), 20.0, 5.0, 5.0, estimate=[*arm.parameters, 0.0, 0.0], offset=True)
    assert law.parameter_names[-2:] == ("offset[joint1]", "offset[joint2]")
    wrench = np.array([0.0, 5.0, 0.0])
    options: dict[str, Any] = {"t_end": 20.0, "dt": 1e-3, "record_every": 100, "force": wrench, "force_frame": "link2"}
    run = al.simulate(al.RigidArm(arm), law, [0.0, 0.0], **options)
    assert run.estimate is not None
    np.testing.assert_allclose(run.q[-1], [0.3, 0.5], atol=1e-4)
    torque = -(arm.jacobian(run.q[-1], "link2")[:3].T @ wrench)
    np.testing.assert_allclose(run.estimate[-1][-2:], torque, atol=2e-3)
    plain = al.simulate(al.RigidArm(arm), law.replace(offset=False, estimate=arm.parameters), [0.0, 0.0], **options)
    assert np.abs(plain.q[-1] - [0.3, 0.5]).max() > 0.05
