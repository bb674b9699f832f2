"""Serial arms against the 25-digit vectors: dynamics, Christoffel matrix and Slotine-Li regressor."""

from __future__ import annotations

import copy
import json
import pickle
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

VECTORS = json.loads((Path(__file__).parents[1] / "vectors" / "oracle_g_regressor_public.json").read_text())["cases"]


@pytest.mark.parametrize("case", VECTORS, ids=lambda case: case["id"])
def test_chain(case: dict[str, Any]) -> None:
    given, expected = case["input"], case["expected"]
    arm = al.Arm.from_chain(given["chain"]["joints"], gravity=[float(x) for x in given["chain"]["gravity"]])
    q, v, v_r, a_r = (np.array(given[name], dtype=float) for name in ("q", "qd", "qd_r", "qdd_r"))
    # The file states the tolerance.
    close = {"rtol": case["tolerance"]["rel"], "atol": case["tolerance"]["abs"]}
    regressor = arm.regressor(q, v, v_r, a_r)
    np.testing.assert_allclose(regressor @ arm.parameters, expected["tau"], **close)
    np.testing.assert_allclose(arm.mass_matrix(q), expected["M"], **close)
    np.testing.assert_allclose(arm.coriolis_matrix(q, v), expected["C"], **close)
    np.testing.assert_allclose(arm.gravity(q), expected["g"], **close)
    if "Y" in expected:
        np.testing.assert_allclose(regressor, expected["Y"], **close)


def test_a_batch_is_its_rows() -> None:
    arm = models.SEVEN_AXES
    q, v, a = np.random.default_rng(7).uniform(-2.0, 2.0, (3, 300, arm.n))
    frame = arm.frame_names[-1]
    for batch, row in (
        (arm.inverse_dynamics(q, v, a), lambda i: arm.inverse_dynamics(q[i], v[i], a[i])),
        (arm.jacobian(q, frame), lambda i: arm.jacobian(q[i], frame)),
        (arm.regressor(q, v, v, a), lambda i: arm.regressor(q[i], v[i], v[i], a[i])),
    ):
        for i in (0, 7, 8, 299):
            # SIMD lanes and single calls may round in a different order. The entries are at most 51.
            np.testing.assert_allclose(batch[i], row(i), rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(arm.forward_dynamics(q, v, arm.inverse_dynamics(q, v, a)), a, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("name", ["planar_2r", "planar_pr", "macro_micro_4r", "six_axis", "seven_axis", "two_arms"])
def test_examples_keep_through_pickle_and_urdf(name: str) -> None:
    arm = al.load_urdf(al.example_urdf(name))
    assert copy.copy(arm) == pickle.loads(pickle.dumps(arm)) == arm
    text, _ = arm.to_urdf()
    again = al.load_urdf(text)
    assert again.joint_names == arm.joint_names
    q = np.linspace(-1.0, 1.0, arm.n)
    # The URDF text rounds angles and centres of mass to decimal numbers.
    np.testing.assert_allclose(again.mass_matrix(q), arm.mass_matrix(q), rtol=1e-12, atol=1e-12)
    assert name.split("_")[0] and str(arm.n) in repr(arm)


def test_names_and_models_that_are_wrong() -> None:
    arm = al.planar_arm([1.0, 1.0])
    with pytest.raises(al.InputError, match="frame is unknown: expected one of the frames link1, link2"):
        arm.position([0.0, 0.0], "tip")
    with pytest.raises(al.InputError, match="arm has no links"):
        models.PR.with_gravity([0.0, 0.0, 0.0])
    with pytest.raises(al.ModelError) as caught:
        al.load_urdf("<robot name='a'>\n<link name='x'/>\n<link name='x'/>\n</robot>")
    assert caught.value.line == 3
    with pytest.raises(al.InputError, match=r'joints\[0\]\["type"\] is unknown'):
        al.Arm.from_chain([{"type": "helical"}])
