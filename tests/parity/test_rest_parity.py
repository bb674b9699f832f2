"""Rest under forces and contacts, and the limits of elastic control, against `armlet.reference`.

armlet uses Newton's method with absolute eigenvalues and dual numbers. The reference takes implicit steps of a slow flow, with differences
for derivatives. Its sampled loop is a Taylor series, and its limits are roots of polynomials and bisections.
"""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from loops import close

import armlet as al
from armlet import reference

K, B, B0 = np.array([900.0, 700.0, 500.0]), np.array([0.4, 0.3, 0.2]), np.array([0.02, 0.012, 0.004])
Q = np.array([0.4, 0.7, 0.5])


def law(library: Any, name: str, arm: Any, target: Any) -> Any:
    joints = ([60.0, 40.0, 20.0], [4.0, 2.0, 0.5])
    task, inner = ([300.0, 250.0, 60.0], [10.0, 10.0, 1.5]), (K, B, B0)
    match name:
        case "PDGravity":
            return library.PDGravity(arm, Q + 0.1, *joints)
        case "CartesianImpedance":
            return library.CartesianImpedance(arm, target, *task, frame="link3", axes="xy rz")
        case "ElasticImpedance":
            return library.ElasticImpedance(arm, target, *task, *inner, frame="link3", axes="xy rz", damping_ratio=0.8)
        case "JointImpedance":
            return library.JointImpedance(arm, Q + 0.1, *joints, *inner, motor_damping=[9.0, 7.0, 5.0])
        case "MotorPD":
            return library.MotorPD(arm, Q + 0.1, [200.0, 150.0, 90.0], joints[1], K)
        case _:
            return library.StateFeedback(arm, Q + 0.1, [200.0, 150.0, 90.0], joints[1], 0.3 * np.ones(3), 0.01 * np.ones(3), K)


def plants(name: str, **keywords: Any) -> list[tuple[Any, Any, Any]]:
    """Return a tuple of library, plant and law for each of the two libraries."""
    found = []
    for library in (al, reference):
        arm = library.planar_arm([0.5, 0.4, 0.3])
        at = models.THREE_LINKS.position(Q, "link3")
        rigid = name in ("PDGravity", "CartesianImpedance")
        made = {each: getattr(library, kind)(**given) for each, (kind, given) in keywords.items()}
        plant = library.RigidArm(arm, **made) if rigid else library.ElasticArm(arm, K, B, **made)
        found.append((library, plant, law(library, name, arm, [*at[:2], Q.sum()])))
    return found


LAWS = ["PDGravity", "CartesianImpedance", "ElasticImpedance", "JointImpedance", "MotorPD", "StateFeedback"]
WALL = ("Wall", {"frame": "link3", "point": [0.0, 0.7, 0.0], "normal": [0.1, -1.0, 0.0], "stiffness": 800.0, "damping": 5.0})
STOPS = ("JointStops", {"stiffness": 40.0, "damping": 3.0, "lower": [-3.0, -3.0, -3.0], "upper": [3.0, 0.5, 3.0]})


@pytest.mark.parametrize("contact", ["free", "wall", "stops"])
@pytest.mark.parametrize("name", LAWS)
def test_rest(name: str, contact: str) -> None:
    """Rest poses agree to 1e-9, and eigenvalues to 1e-6 of the largest.

    Derivatives of the reference are extrapolated differences. Contacts are deeper than the step of the
    differences, 0.01 rad.
    """
    keywords = {} if contact == "free" else {"wall": WALL} if contact == "wall" else {"stops": STOPS}
    task = name in ("CartesianImpedance", "ElasticImpedance")
    given: dict[str, Any] = {"force": [8.0, -5.0, 0.6]} if task else {"force": [8.0, -5.0, 0.0], "force_frame": "link2"}
    ours, theirs = (library.equilibrium(plant, each, q0=Q, **given) for library, plant, each in plants(name, **keywords))
    close(ours.q, theirs.q, 1e-9)
    close(ours.tau, theirs.tau, 1e-8)
    close(ours.x, theirs.x, 1e-9)
    np.testing.assert_allclose(ours.residual, 0.0, rtol=0.0, atol=1e-9)
    if ours.theta is not None:
        close(ours.theta, theirs.theta, 1e-9)
    assert (ours.reachable, ours.stable) == (theirs.reachable, theirs.stable)
    if contact == "free":
        assert ours.spurious == theirs.spurious
    close(np.sort(np.abs(ours.eigenvalues)), np.sort(np.abs(theirs.eigenvalues)), 1e-6)
    free = al.equilibrium(*plants(name)[0][1:], q0=Q, **given)
    assert (contact == "free") == bool(np.abs(free.q - ours.q).max() < 1e-6)
    still = al.equilibrium(*plants(name, **keywords)[0][1:], q0=Q)
    assert np.abs(still.q - ours.q).max() > 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("bandwidth", [None, 2000.0])
@pytest.mark.parametrize("name", ["ElasticImpedance", "JointImpedance"])
def test_elastic_limits(name: str, bandwidth: float | None) -> None:
    given: dict[str, Any] = {"force": [4.0, -3.0, 0.0], "force_frame": "link2", "sample_time": 1e-3, "sensor_bandwidth": bandwidth}
    ours, theirs = (library.elastic_limits(plant, each, q0=Q, **given) for library, plant, each in plants(name))
    # Both codes find these limits by bisection.
    assert ours.sample_time_max == pytest.approx(theirs.sample_time_max, rel=1e-6)
    close(ours.reduced_inertia_min / theirs.reduced_inertia_min, np.ones(3), 1e-6)
    none = np.isnan(theirs.stiffness_max)
    assert np.all(ours.stiffness_max[none] <= 0.0)
    close(ours.stiffness_max[~none] / theirs.stiffness_max[~none], np.ones((~none).sum()), 1e-8)
    close(ours.stiffness, theirs.stiffness, 1e-9)
    # The reference's bisection stops at 1e-6 of the stiffness.
    assert ours.stiffness_scale_max == pytest.approx(theirs.stiffness_scale_max, rel=1e-5)


def test_limits_by_numbers() -> None:
    rng = np.random.default_rng(5)
    for _ in range(5):
        inertia, stiffness, zeta, dt = rng.uniform(0.1, 1.0), rng.uniform(200.0, 2000.0), rng.uniform(0.5, 1.5), rng.uniform(2e-4, 2e-3)
        options = {"damping_ratio": zeta, "sensor_bandwidth": rng.uniform(1500.0, 6000.0)}
        ours = float(al.smallest_reduced_inertia(inertia, stiffness, dt, **options))
        # Both codes bisect the spectral radius, which hardly changes near the limit.
        np.testing.assert_allclose(ours, reference.smallest_reduced_inertia(inertia, stiffness, dt, **options), rtol=1e-6)
        mass, b0, d, d0 = rng.uniform(0.3, 2.0), rng.uniform(0.01, 0.1), rng.uniform(0.0, 10.0), rng.uniform(2.0, 20.0)
        limit = float(al.stiffness_limit(mass, stiffness, b0, d, motor_damping=d0))
        expected = reference.stiffness_limit(mass, stiffness, b0, d, motor_damping=d0)
        assert limit <= 0.0 if np.isnan(expected) else abs(limit / expected - 1.0) < 1e-8


@pytest.mark.parametrize("n", [1, 2, 5, 8])
def test_damping_from_ratio(n: int) -> None:
    """Damping matrices agree to 1e-12."""
    rng = np.random.default_rng(n)
    halves = rng.standard_normal((2, n, n))
    M, S = halves @ halves.transpose(0, 2, 1) / n + 0.2 * np.eye(n)
    close(al.damping_from_ratio(M, 50.0 * S, 0.7), reference.damping_from_ratio(M, 50.0 * S, 0.7), 1e-12)


@pytest.mark.parametrize("elastic", [False, True])
@pytest.mark.parametrize("axes", ["x", "xy"])
def test_free_motions(axes: str, elastic: bool) -> None:
    """Without a posture task, the number of free motions and the other eigenvalues agree."""
    found = []
    for kit in (al, reference):
        arm = kit.planar_arm([0.5, 0.4, 0.3])
        given = (arm, [0.5, 0.3][: len(axes)], 300.0, 10.0 if elastic else 60.0)
        law = (
            kit.ElasticImpedance(*given, 800.0, 0.3, 0.05, frame="link3", axes=axes)
            if elastic
            else kit.CartesianImpedance(*given, frame="link3", axes=axes)
        )
        plant = kit.ElasticArm(arm, np.full(3, 800.0), np.full(3, 0.3)) if elastic else kit.RigidArm(arm)
        found.append(kit.equilibrium(plant, law, [6.0, -3.0][: len(axes)], q0=[0.2, 0.5, 0.4]))
    ours, theirs = found
    assert ours.free_motions == theirs.free_motions == 3 - len(axes) and ours.stable and theirs.stable
    # Null-space motions connect many rest poses, and the two searches stop at different ones. The tip position is equal, and the
    # eigenvalues are those of the same pose.
    close(ours.x, theirs.x, 1e-8)
    again = reference.equilibrium(plant, law, [6.0, -3.0][: len(axes)], q0=ours.q)
    close(again.q, ours.q, 1e-7)
    scale = np.abs(ours.eigenvalues).max()
    np.testing.assert_allclose(
        np.sort_complex(np.round(ours.eigenvalues / scale, 7)), np.sort_complex(np.round(again.eigenvalues / scale, 7)), atol=1e-6
    )


@pytest.mark.parametrize("case", ["free motion", "motor limit", "joint stiffness"])
def test_residuals_and_equilibria_of_imperfect_loops(case: str) -> None:
    """A force along a free motion, a motor at its limit with a full motor inertia, and a law with another joint stiffness."""
    found = []
    for kit in (al, reference):
        if case == "free motion":
            cart = {"type": "P", "phi": [2.0, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1]}
            rail = kit.Arm.from_chain([cart | {"axis": [1, 0, 0]}, cart | {"axis": [0, 1, 0]}], gravity=[0.0, -2.0, -9.0])
            law = kit.CartesianImpedance(rail, [0.3], 300.0, 40.0, frame="link2", axes="y")
            given: dict[str, Any] = {"force": [10.0, 3.0, 0.0], "force_frame": "link2", "q0": [0.0, 0.1]}
            found.append(kit.equilibrium(kit.RigidArm(rail), law, **given))
            continue
        arm = kit.planar_arm([0.5, 0.4])
        stiffness, motors = np.array([800.0, 500.0]), np.array([[0.4, 0.1], [0.1, 0.25]])
        believed, more = (0.8, {}) if case == "joint stiffness" else (1.0, {"tau_max": [12.0, 40.0]})
        arguments: Any = ([0.8, 0.3], 900.0 * np.eye(2), 40.0 * np.eye(2), np.diag(believed * stiffness), motors, np.diag([0.02, 0.0125]))
        law = kit.ElasticImpedance(arm, *arguments, frame="link2", axes="xy", **more)
        found.append(kit.equilibrium(kit.ElasticArm(arm, np.diag(stiffness), motors), law, [-40.0, 10.0], q0=[0.3, 0.9]))
    ours, theirs = found
    close(ours.residual, theirs.residual, 1e-7)
    if case != "motor limit":
        # The differences of the reference, over 0.01 rad, cross the limit. So its eigenvalues there are not those of the equilibrium.
        assert (ours.reachable, ours.stable) == (theirs.reachable, theirs.stable)
    if case == "free motion":
        np.testing.assert_allclose(ours.residual, [10.0, 0.0], rtol=0.0, atol=1e-9)
        assert not ours.stable and not ours.reachable
    else:
        close(ours.q, theirs.q, 1e-8)
        close(ours.tau, theirs.tau, 1e-7)
