"""The contact force of a wall: compared with joint torques that the reference computes, in rows of a batch, and in files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet.reference import contact

ARM = models.TWO_LINKS
LAW = al.CartesianImpedance(ARM, [0.75, 0.2], 300.0, 40.0, frame="link2", axes="xy")
WALLS: list[dict[str, Any]] = [
    {"point": [0.7, 0.0, 0.0], "normal": [-2.0, 0.3, 0.0], "stiffness": 1e3, "damping": 20.0},
    {"point": [0.65, 0.1, 0.0], "normal": [-1.0, 0.0, 0.0], "stiffness": 5e3},
]
PLANTS = [al.RigidArm(ARM, wall=al.Wall("link2", **wall)) for wall in WALLS]


@pytest.mark.parametrize("kind", [0, 1])
def test_against_the_torques_of_the_reference(kind: int) -> None:
    """The torque is `tau = J' n f`. The reference computes `-f dd/dq` by a complex step of the depth d."""
    run = al.simulate(PLANTS[kind], LAW, [0.8, 1.2], t_end=0.6, dt=1e-3)
    assert run.contact_force is not None and run.contact_force.shape == (len(run),)
    (wall,) = contact.contacts(models.REFERENCE_TWO_LINKS, contact.Wall("link2", **WALLS[kind]), None)
    n = np.array(WALLS[kind]["normal"]) / np.linalg.norm(WALLS[kind]["normal"])
    for q, v, force in zip(run.q[::7], run.v[::7], run.contact_force[::7], strict=True):
        wanted = contact.push(wall, q, v)[0]
        # The contact forces are at most 31 N. Both sides agree up to rounding.
        np.testing.assert_allclose(ARM.jacobian(q, "link2")[:3].T @ n * force, wanted, rtol=1e-11, atol=1e-11)
    assert run.contact_force.max() > 1.0 and (run.contact_force == 0.0).any()


def test_rows_and_files(tmp_path: Path) -> None:
    """A row of a batch has the force of its plant's wall.

    A file stores the force. A batch with a plant without a wall has no contact forces.
    """
    batch = al.simulate_batch(PLANTS, [LAW, LAW], [[0.8, 1.2]] * 2, t_end=0.6, dt=1e-3, keep="all")
    assert batch.contact_force is not None and batch.contact_force.shape == (2, batch.q.shape[1])
    for i, plant in enumerate(PLANTS):
        alone = al.simulate(plant, LAW, [0.8, 1.2], t_end=0.6, dt=1e-3)
        np.testing.assert_array_equal(batch[i].contact_force, batch.contact_force[i])
        # Batches and single runs may differ by rounding, which a stiff wall amplifies.
        assert alone.contact_force is not None
        np.testing.assert_allclose(batch.contact_force[i], alone.contact_force, rtol=1e-6, atol=1e-6)
    batch.save(tmp_path / "batch.npz")
    np.testing.assert_array_equal(al.load(tmp_path / "batch.npz").contact_force, batch.contact_force)
    mixed = al.Run({"t": [0.0], "q": [[np.nan, 0.0]], "v": [[0.0, 0.0]]}, plant=PLANTS[0])
    assert mixed.contact_force is not None and np.isnan(mixed.contact_force).all()
    assert al.Run({"t": [0.0], "q": [[0.0, 0.0]], "v": [[0.0, 0.0]]}, plant=al.RigidArm(ARM)).contact_force is None
