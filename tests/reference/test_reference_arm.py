"""Arms of the reference against vector files, finite differences and identities."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armlet import reference as ref

VECTORS = Path(__file__).parents[1] / "vectors"
STATIC = json.loads((VECTORS / "oracle_g_regressor_public.json").read_text())["cases"]
RUNS = json.loads((VECTORS / "oracle_g_adaptive_ndof_public.json").read_text())["cases"]


def floats(value: Any) -> np.ndarray:
    return np.array(value, dtype=np.float64)


def chain(given: dict[str, Any]) -> Any:
    return ref.Arm.from_chain(given["joints"], gravity=floats(given["gravity"]))


def random_tree(rng: np.random.Generator, n: int) -> Any:
    joints: list[dict[str, Any]] = []
    for index in range(n):
        half = rng.normal(size=(3, 4))
        points = half @ half.T  # second moments of four points: consistent
        mass, com = rng.uniform(0.5, 2.0), rng.normal(size=3) * 0.1
        second = points * 0.01 + mass * np.outer(com, com)
        inertia = np.trace(second) * np.eye(3) - second
        joints.append(
            {
                "type": "P" if rng.random() < 0.3 else "R",
                "axis": rng.normal(size=3),
                "rpy": rng.uniform(-3, 3, 3),
                "xyz": rng.normal(size=3) * 0.3,
                "phi": [mass, *(mass * com), *inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]],
                "parent": rng.integers(-1, index) if index else -1,
            }
        )
    return ref.Arm.from_chain(joints, gravity=rng.normal(size=3) * 5)


def test_the_vector_files_are_whole() -> None:
    assert len(STATIC) == 7 and len(RUNS) == 2


@pytest.mark.parametrize("case", STATIC, ids=lambda case: case["id"])
def test_regressor_vectors(case: dict[str, Any]) -> None:
    given, expected, tolerance = case["input"], case["expected"], case["tolerance"]
    arm = chain(given["chain"])
    q, v, v_r, a_r = (floats(given[key]) for key in ("q", "qd", "qd_r", "qdd_r"))
    Y = arm.regressor(q, v, v_r, a_r)
    got = {
        "M": arm.mass_matrix(q),
        "C": arm.coriolis_matrix(q, v),
        "g": arm.gravity(q),
        "Mdot": arm.mass_matrix_rate(q, v),
        "Y": Y,
        "tau": Y @ arm.parameters,
    }
    for key, value in got.items():
        np.testing.assert_allclose(value, floats(expected[key]), rtol=tolerance["rel"], atol=tolerance["abs"], err_msg=key)


def test_vectors_distinguish_the_factorisations() -> None:
    apart = [np.abs(floats(c["expected"]["tau"]) - floats(c["expected"]["tau_non_christoffel_admissible"])).max() for c in STATIC]
    assert max(apart) > 1e-3


@pytest.mark.parametrize("case", RUNS, ids=lambda case: case["id"])
def test_adaptive_runs(case: dict[str, Any]) -> None:
    given, samples, atol = case["input"], case["expected"]["samples"], case["tolerance"]["abs"]
    arm = chain(given["chain"])
    joints = given["reference"]
    terms = np.array([joint["terms"] for joint in joints], dtype=np.float64)
    motion = ref.Sinusoid(floats([joint["offset"] for joint in joints]), terms[..., 0], terms[..., 1], terms[..., 2])
    kd = floats(given["K_D"])
    law = ref.Adaptive(arm, motion, kd * floats(given["Lambda"]), kd, np.tile(floats(given["Gamma_per_link"]), arm.n))
    times = floats(given["times"])
    run = ref.simulate(
        ref.RigidArm(arm), law, given["q0"], v0=given["qd0"], t_end=times[-1], t_eval=times, method="gbs", rtol=1e-9, atol=1e-10
    )
    names = {"q": "q", "qd": "v", "a_hat": "estimate", "tau": "tau", "s": "s", "V1": "lyapunov", "int_sKDs": "dissipated"}
    for row, sample in enumerate(samples):
        for theirs, ours in names.items():
            np.testing.assert_allclose(run[ours][row], floats(sample[theirs]), rtol=0.0, atol=atol, err_msg=f"{theirs} at t = {times[row]}")
    first = law.lyapunov(0.0, floats(given["q0"]), floats(given["qd0"]), law.state0, ref.RigidArm(arm))
    assert abs(first - case["expected"]["V1_0"]) < atol


@pytest.mark.parametrize("n", [1, 2, 3, 5, 8])
def test_identities(n: int) -> None:
    rng = np.random.default_rng(n)
    arm = random_tree(rng, n)
    q, v, x, a = rng.normal(size=(4, 6, n))
    C = arm.coriolis_matrix(q, v)
    scale = 1.0 + np.abs(C).max()
    # The identities hold up to rounding.
    np.testing.assert_allclose(arm.mass_matrix_rate(q, v), C + np.swapaxes(C, -1, -2), atol=1e-12 * scale)
    left = np.einsum("bij,bj->bi", C, x)
    np.testing.assert_allclose(left, np.einsum("bij,bj->bi", arm.coriolis_matrix(q, x), v), atol=1e-12 * scale)
    assert np.linalg.eigvalsh(arm.mass_matrix(q)).min() > 0
    tau = arm.inverse_dynamics(q, v, a)
    np.testing.assert_allclose(arm.regressor(q, v, v, a) @ arm.parameters, tau, atol=1e-11 * (1 + np.abs(tau).max()))
    np.testing.assert_allclose(arm.forward_dynamics(q, v, tau), a, atol=1e-9)
    h = 1e-6
    slopes = [(arm.energy(q + h * e, v)[1] - arm.energy(q - h * e, v)[1]) / (2 * h) for e in np.eye(n)]
    # The rounding error of the potential is divided by the step. The slopes agree to 6e-9 N m or N.
    np.testing.assert_allclose(arm.gravity(q), np.stack(slopes, axis=-1), atol=1e-7)


def test_jacobian_is_the_slope_of_the_pose() -> None:
    rng = np.random.default_rng(3)
    arm = random_tree(rng, 6)
    q, v = rng.normal(size=(2, 6))
    h = 1e-6
    for frame in arm.frames:
        J = arm.jacobian(q, frame)
        after, before = arm.pose(q + h * v, frame), arm.pose(q - h * v, frame)
        rate = (after - before) / (2 * h)
        spin = rate[:3, :3] @ arm.pose(q, frame)[:3, :3].T
        # The central differences have truncation errors of order h^2 and rounding errors of 1e-16/h, both below 1e-9.
        np.testing.assert_allclose(J @ v, [*rate[:3, 3], spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-8)
        slope = (arm.jacobian(q + h * v, frame) - arm.jacobian(q - h * v, frame)) / (2 * h)
        np.testing.assert_allclose(arm.jacobian_dot(q, v, frame), slope, atol=1e-8)


def test_a_fixed_link_is_its_carrier() -> None:
    rng = np.random.default_rng(4)
    phi = [1.3, 0.1, -0.2, 0.05, 0.3, 0.01, 0.4, -0.02, 0.03, 0.5]
    first = {"type": "R", "axis": (0, 0.6, 0.8), "rpy": (0.1, 0.2, 0.3), "xyz": (0.1, 0.2, 0.3), "phi": phi}
    tool = {"type": "fixed", "rpy": (0.5, -0.4, 1.0), "xyz": (0.3, 0.0, -0.1), "phi": phi}
    last = {"type": "P", "axis": (1, 2, 2), "rpy": (0.0, 0.7, 0.0), "xyz": (0.0, 0.4, 0.0), "phi": phi}
    merged = ref.Arm.from_chain([first, tool, last])
    # A revolute joint that does not move replaces the fixed joint. Dynamics of the moving joints must agree.
    loose = ref.Arm.from_chain([first, tool | {"type": "R", "axis": (0, 0, 1)}, last])
    q, v, a = rng.normal(size=(3, 2))
    held = [np.insert(x, 1, 0.0) for x in (q, v, a)]
    assert merged.n == 2 and merged.parameters.shape == (20,)
    np.testing.assert_allclose(merged.inverse_dynamics(q, v, a), loose.inverse_dynamics(*held)[[0, 2]], atol=1e-12)
    np.testing.assert_allclose(merged.pose(q, "link3"), loose.pose(held[0], "link3"), atol=1e-14)


def test_planar_arm_against_its_textbook_form() -> None:
    l1, m1, m2, d1, d2, I1, I2, g0 = 0.5, 3.0, 2.0, 0.25, 0.2, 0.0625, 0.027, 9.81
    arm = ref.planar_arm([l1, 0.4], masses=[m1, m2], coms=[d1, d2], inertias=[I1, I2])
    q = np.array([0.7, -1.1])
    c2 = np.cos(q[1])
    a, b, c = I1 + m1 * d1**2 + I2 + m2 * (l1**2 + d2**2), m2 * l1 * d2, I2 + m2 * d2**2
    np.testing.assert_allclose(arm.mass_matrix(q), [[a + 2 * b * c2, c + b * c2], [c + b * c2, c]], atol=1e-14)
    g2 = m2 * g0 * d2 * np.cos(q.sum())
    np.testing.assert_allclose(arm.gravity(q), [(m1 * d1 + m2 * l1) * g0 * np.cos(q[0]) + g2, g2], atol=1e-13)
    tip = l1 * np.exp(1j * q[0]) + 0.4 * np.exp(1j * q.sum())
    np.testing.assert_allclose(arm.position(q, "link2"), [tip.real, tip.imag, 0.0], atol=1e-15)


def test_unknown_names_are_refused() -> None:
    arm = ref.planar_arm([1.0, 1.0])
    with pytest.raises(ValueError, match="link1"):
        arm.jacobian([0.0, 0.0], "hand")
    with pytest.raises(ValueError, match="type is unknown"):
        ref.Arm.from_chain([{"type": "ball", "axis": (0, 0, 1)}])


def test_rotor_inertia_is_on_the_diagonal_and_not_in_the_regressor() -> None:
    rng = np.random.default_rng(6)
    bare = random_tree(rng, 4)
    armature = np.array([0.1, 0.0, 0.3, 0.2])
    arm = bare.with_parameters(bare.parameters)
    arm.armature = armature
    q, v, a = rng.normal(size=(3, 4))
    np.testing.assert_allclose(arm.mass_matrix(q), bare.mass_matrix(q) + np.diag(armature), atol=1e-14)
    tau = arm.regressor(q, v, v, a) @ arm.parameters + armature * a
    np.testing.assert_allclose(tau, arm.inverse_dynamics(q, v, a), atol=1e-11)
    np.testing.assert_allclose(arm.forward_dynamics(q, v, tau), a, atol=1e-10)
    assert arm.energy(q, v)[0] == pytest.approx(bare.energy(q, v)[0] + 0.5 * armature @ v**2)
