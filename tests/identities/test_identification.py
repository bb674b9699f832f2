"""Base parameters span the regressor, impossible bodies are detected, and identification of a record returns the parameters."""

from __future__ import annotations

import copy
import pickle
import re

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al
from armlet.reference.inertia import PSEUDO

Array = NDArray[np.float64]

ARMS = {
    **{name: al.load_urdf(al.example_urdf(name)) for name in ("planar_2r", "planar_pr", "six_axis", "seven_axis", "two_arms")},
    "pendulum": al.pendulum(2.0, 3.0),
    "without gravity": al.load_urdf(al.example_urdf("seven_axis"), gravity=[0.0, 0.0, 0.0]),
    "skew": al.Arm.from_chain(
        [
            {"type": "R", "axis": [0.3, -0.5, 0.8], "rpy": [0.1, 0.2, 0.3], "xyz": [0.1, 0.0, 0.2], "phi": [1.0] * 10},
            {"type": "P", "axis": [0.0, 0.6, 0.8], "rpy": [0.4, -0.2, 0.1], "xyz": [0.3, 0.1, 0.0], "phi": [1.0] * 10},
            {"type": "R", "axis": [1.0, 0.0, 0.0], "rpy": [0.0, 0.7, 0.0], "xyz": [0.0, 0.3, 0.1], "phi": [1.0] * 10, "parent": 0},
        ]
    ),
}


def states(arm: al.Arm, count: int, seed: int) -> Array:
    """Random q, v, v_r, a_r, (count, n) each."""
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (4, count, arm.n))


@pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS.keys())
@pytest.mark.parametrize("extra", [False, True])
def test_base_parameters(arm: al.Arm, extra: bool) -> None:
    base = arm.base_parameters(armature=extra, friction=extra)
    q, v, v_r, a_r = states(arm, 60, 1)
    full = arm.regressor(q, v, v_r, a_r, armature=extra, friction=extra)
    small = base.regressor(q, v, v_r, a_r)
    assert small.shape == (60, arm.n, base.count) and base.projection.shape == (base.count, full.shape[-1])
    # The tolerance covers rounding in the solution of two triangular systems.
    np.testing.assert_allclose(small @ base.projection, full, rtol=0.0, atol=1e-11 * np.abs(full).max())
    pi = np.random.default_rng(2).normal(size=full.shape[-1])
    np.testing.assert_allclose(small @ (base.projection @ pi), full @ pi, rtol=0.0, atol=1e-11 * np.abs(full).max() * np.abs(pi).max())
    # `base.count` equals the rank that numpy computes for the regressor at other states, with columns of norm one.
    stacked = full.reshape(-1, full.shape[-1])
    lengths = np.linalg.norm(stacked, axis=0)
    scaled = stacked[:, lengths > 1e-9 * lengths.max()] / lengths[lengths > 1e-9 * lengths.max()]
    assert np.linalg.matrix_rank(scaled, tol=1e-7) == base.count
    # Kept and dropped columns differ clearly.
    assert base.smallest_kept > 1e-4 and base.largest_dropped < 1e-12
    assert len(base.grouping) == base.count and all(base.names[j] in text for j, text in zip(base.columns, base.grouping, strict=True))
    np.testing.assert_array_equal(base.projection[:, base.columns], np.eye(base.count))
    limits = arm.limits
    everything = np.concatenate([arm.parameters, *([limits["armature"], limits["damping"], limits["friction"]] if extra else [])])
    np.testing.assert_allclose(base.values, base.projection @ everything, rtol=1e-15)


def test_counts_of_the_literature() -> None:
    """The numbers of base parameters equal those of the literature: 43 for seven revolute axes under gravity.

    A planar 2R arm with gravity in its plane has six: two first moments of two components, and two inertias. The horizontal PR arm has
    four: the mass of both links, and two components of the first moment and one inertia of link 2.
    """
    assert ARMS["seven_axis"].base_parameters().count == 43
    assert ARMS["planar_2r"].base_parameters().count == 6
    assert ARMS["pendulum"].base_parameters().grouping == ("mcx[joint1]", "mcy[joint1]", "Izz[joint1]")
    assert ARMS["planar_pr"].with_gravity([0.0, 0.0, 0.0]).base_parameters().count == 4
    base = ARMS["pendulum"].base_parameters()
    again = pickle.loads(pickle.dumps(base))
    assert again.grouping == base.grouping and repr(copy.copy(base)) == "<BaseParameters: 3 of 10>"


def pseudo(pi: Array) -> Array:
    return np.tensordot(pi.reshape(-1, 10), PSEUDO, axes=1)


@pytest.mark.parametrize("name", ["six_axis", "seven_axis"])
def test_impossible_bodies_are_named_and_moved(name: str) -> None:
    arm = ARMS[name]
    pi = arm.parameters
    assert arm.check_parameters() and str(arm.check_parameters(pi)) == f"all {arm.n} bodies are physically possible"
    # Each body's eigenvalues equal those of numpy.
    np.testing.assert_allclose(arm.check_parameters(pi).eigenvalues, np.linalg.eigvalsh(pseudo(pi)), rtol=1e-10, atol=1e-14)
    wrong = pi.copy()
    wrong[0], wrong[29] = -0.5, 5.0
    report = arm.check_parameters(wrong)
    assert not report and report.inconsistent == (arm.joint_names[0], arm.joint_names[2])
    assert "mass -0.5 is not positive" in report.problems[0] and "triangle" in report.problems[2] and not report.problems[1]
    moved = arm.project_parameters(wrong)
    assert arm.check_parameters(moved)
    untouched = np.r_[10:20, 30 : 10 * arm.n]
    np.testing.assert_array_equal(moved[untouched], pi[untouched])
    np.testing.assert_array_equal(al.project_parameters(moved), moved)
    # The projection is the nearest possible body: no possible body near `moved` has a smaller distance to `wrong`, in the weighted
    # Frobenius norm of the pseudo-inertias.
    scale = np.array([10.0, 10.0, 10.0, 1.0])
    weigh = lambda x: pseudo(x) * scale[:, None] * scale  # noqa: E731
    distance = np.linalg.norm(weigh(moved) - weigh(wrong))
    rng = np.random.default_rng(3)
    tried = 0
    while tried < 200:
        other = moved + rng.normal(size=moved.size) * np.repeat(rng.choice([1e-6, 1e-4, 1e-2]), moved.size)
        if arm.check_parameters(other):
            tried += 1
            # The projection keeps a margin of 1e-6 of the largest eigenvalue, so its distance is not exactly the smallest.
            assert np.linalg.norm(weigh(other) - weigh(wrong)) >= distance * (1.0 - 1e-4)


def test_project_refuses() -> None:
    with pytest.raises(al.InputError, match="project_parameters: pi has no body to scale by"):
        al.project_parameters(-np.array([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0]))
    with pytest.raises(al.InputError, match="pi has the wrong length: expected a multiple of 10, got 9"):
        al.project_parameters(np.ones(9))
    with pytest.raises(al.InputError, match="length is not positive"):
        al.project_parameters(np.ones(10), length=0.0)
    with pytest.raises(al.InputError, match=r"pi has the wrong shape: expected \(70,\), got \(60,\)"):
        ARMS["seven_axis"].check_parameters(np.ones(60))
    with pytest.raises(al.InputError, match="arm has no links"):
        models.PR.check_parameters()


@pytest.mark.parametrize("name", ["planar_2r", "six_axis", "two_arms"])
def test_a_clean_record_gives_the_parameters_back(name: str) -> None:
    arm = ARMS[name]
    q, v, a, _ = states(arm, 400, 4)
    tau = arm.inverse_dynamics(q, v, a, friction=True)
    found = arm.identify(q, v, a, tau, armature=True, friction=True)
    assert found.rank == found.base.count and found.condition < 100.0 and found.unidentified == ()
    np.testing.assert_allclose(found.values, found.base.values, rtol=1e-10, atol=1e-11)
    # Of all arms with the identified base parameters, `found.arm` is nearest to `arm`. The record is exact, so they agree up to rounding.
    np.testing.assert_allclose(found.arm.parameters, arm.parameters, rtol=1e-9, atol=1e-10)
    wrong = arm.with_parameters(arm.parameters * 1.3)
    again = wrong.identify(q, v, a, tau, armature=True, friction=True)
    np.testing.assert_allclose(again.values, found.values, rtol=1e-10, atol=1e-11)
    rotors = arm.limits["armature"] * a  # `again.arm` keeps the rotors of `wrong`, which are the arm's
    torque = again.base.regressor(q, v, v, a) @ again.values
    np.testing.assert_allclose(torque, tau, rtol=0.0, atol=1e-10 * np.abs(tau).max())
    assert rotors.shape == tau.shape


def test_the_arm_given_by_three_parameters() -> None:
    """A, B and C are base parameters. They are identified from noisy records within their deviations, and `found.arm` has their values."""
    arm = al.planar_pr(2.0, -0.5, 0.5)
    base = arm.base_parameters()
    assert base.grouping == base.names == ("A", "B", "C") and base.unseen == ()
    np.testing.assert_array_equal(base.values, [2.0, -0.5, 0.5])
    q, v, a, _ = states(arm, 400, 4)
    np.testing.assert_array_equal(base.regressor(q, v, v, a), arm.regressor(q, v, v, a))
    noise = 0.1 * np.random.default_rng(5).normal(size=q.shape)
    found = arm.with_parameters([1.0, 0.0, 1.0]).identify(q, v, a, arm.inverse_dynamics(q, v, a) + noise)
    # The limit is four standard deviations.
    assert (np.abs(found.values - base.values) < 4.0 * found.deviations).all() and (found.deviations < 0.02).all()
    np.testing.assert_allclose(found.arm.parameters, found.values, rtol=1e-14)
    assert arm.base_parameters().regressor(q[0], v[0], v[0], a[0]).shape == (2, 3)
    with pytest.raises(al.InputError, match="armature, offset are not part of this arm"):
        arm.identify(q, v, a, noise, armature=True, offset=True)


def test_drives_are_replaced() -> None:
    arm = ARMS["six_axis"]
    rng = np.random.default_rng(6)
    drives = {name: rng.uniform(0.1, 1.0, arm.n) for name in ("armature", "damping", "friction")}
    other = arm.with_drives(**drives)
    for name, values in drives.items():
        np.testing.assert_array_equal(other.limits[name], values)
        one = arm.with_drives(**{name: values})
        assert all((one.limits[key] == (values if key == name else arm.limits[key])).all() for key in arm.limits)
    q, v, a, _ = states(arm, 5, 7)
    own = arm.with_drives(armature=np.zeros(arm.n)).inverse_dynamics(q, v, a)
    torque = own + drives["armature"] * a + drives["damping"] * v + drives["friction"] * np.sign(v)
    np.testing.assert_allclose(other.inverse_dynamics(q, v, a, friction=True), torque, rtol=1e-12)
    assert arm.with_drives() == arm and other.with_drives(**{name: arm.limits[name] for name in drives}) == arm
    with pytest.raises(al.InputError, match=r"Arm.with_drives: damping has the wrong shape: expected a scalar or \(6,\), got \(2,\)"):
        arm.with_drives(damping=[1.0, 2.0])
    with pytest.raises(al.InputError, match=r"Arm.with_drives: friction is not finite: .*\(first bad index 5\)"):
        arm.with_drives(friction=[0.0] * 5 + [np.nan])


def test_deviations_are_those_of_repeated_records() -> None:
    """2,000 estimates from independent noise have the reported deviations. A joint with ten times the noise has less weight."""
    arm = ARMS["planar_2r"]
    rng = np.random.default_rng(5)
    q, v, a, _ = states(arm, 50, 6)
    clean, noise = arm.inverse_dynamics(q, v, a), np.array([0.3, 0.03])
    found = [arm.identify(q, v, a, clean + noise * rng.normal(size=clean.shape), noise=noise) for _ in range(2000)]
    values = np.array([one.values for one in found])
    # A standard deviation from 2,000 samples has an error of 1.6 %. About four times that is allowed.
    np.testing.assert_allclose(values.std(axis=0), np.mean([one.deviations for one in found], axis=0), rtol=0.07)
    np.testing.assert_allclose(values.mean(axis=0), found[0].base.values, rtol=0.0, atol=4.0 * values.std(axis=0).max() / 2000**0.5)
    np.testing.assert_allclose(np.sqrt(np.diag(found[0].covariance)), found[0].deviations, rtol=1e-12)
    unweighted = arm.identify(q, v, a, clean + noise * rng.normal(size=clean.shape))
    assert (unweighted.deviations > 1.5 * found[0].deviations).sum() >= 3
    np.testing.assert_allclose(found[0].residuals, noise, rtol=0.4)


def test_a_poor_record_names_undetermined_parameters() -> None:
    arm = ARMS["six_axis"]
    q = np.zeros((300, arm.n))
    q[:, 1] = np.linspace(-1.0, 1.0, 300)
    still = np.zeros_like(q)
    found = arm.identify(q, still, still, arm.gravity(q))
    assert found.rank < found.base.count and np.isinf(found.condition) and found.unidentified
    assert np.isfinite(found.values).all() and np.isfinite(found.parameters).all()
    # The identified parameters explain the torques of the record.
    np.testing.assert_allclose(found.base.regressor(q, still, still, still) @ found.values, arm.gravity(q), rtol=0.0, atol=1e-8)
    assert "rank" in str(found) and str(found.base.count) in repr(found)


def test_bad_records_are_refused() -> None:
    arm = ARMS["planar_2r"]
    q = np.ones((10, 2))
    with pytest.raises(al.InputError, match=r"identify: v has the wrong shape: expected \(10, 2\), got \(9, 2\)"):
        arm.identify(q, q[:9], q, q)
    with pytest.raises(al.InputError, match=r"identify: q has the wrong shape: expected \(samples, 2\), got \(2,\)"):
        arm.identify(q[0], q[0], q[0], q[0])
    with pytest.raises(al.InputError, match="identify: q has too few samples: expected more than 3 for 6 base parameters, got 2"):
        arm.identify(q[:2], q[:2], q[:2], q[:2])
    with pytest.raises(al.InputError, match="identify: noise is not positive"):
        arm.identify(q, q, q, q, noise=[1.0, 0.0])
    bad = q.copy()
    bad[7, 1] = np.nan
    with pytest.raises(al.InputError, match=r"identify: tau is not finite: .* \(first bad index \(7, 1\)\)"):
        arm.identify(q, q, q, bad)


def plate(ixx: float, iyy: float, izz: float, mass: float = 1.5) -> al.Arm:
    """One body on a revolute joint, with its centre of mass at a distance of 0.1 m."""
    moments = f'ixx="{ixx!r}" iyy="{iyy!r}" izz="{izz!r}" ixy="0" ixz="0" iyz="0"'
    return al.load_urdf(
        f"""<robot name="plate"><link name="base"/>
        <link name="plate"><inertial><origin xyz="0.1 0 0"/><mass value="{mass!r}"/><inertia {moments}/></inertial></link>
        <joint name="turn" type="revolute"><parent link="base"/><child link="plate"/><axis xyz="0 0 1"/></joint></robot>"""
    )


@pytest.mark.parametrize("slack, warned", [(1e-5, False), (1e-7, False), (-1e-7, False), (-1e-5, True)])
def test_the_triangle_inequality_near_its_border(slack: float, warned: bool) -> None:
    """Reading warns if the inequality is violated by more than 1e-6, since files have rounded values. The consistency check is exact."""
    moment = 0.02
    arm = plate(moment, moment, 2.0 * moment * (1.0 - slack))
    assert any("triangle" in line for line in arm.report) is warned
    assert arm.check_parameters().consistent is (slack > 0.0)
    np.testing.assert_allclose(arm.mass_matrix([0.3]), [[2.0 * moment * (1.0 - slack) + 1.5 * 0.01]], rtol=1e-14)


@pytest.mark.parametrize("size", [1e-7, 1e-12])
def test_negative_moments_within_the_digits_of_files(size: float) -> None:
    """Moments down to -1e-7 kg m^2 count as rounding: reading warns, for every mass. Smaller ones are refused. The check reports both."""
    arm = plate(-0.9 * size, size, size, mass=1e-3)
    assert any("triangle" in line for line in arm.report)
    report = arm.check_parameters()
    assert report.inconsistent == ("turn",) and "smallest is not positive" in report.problems[0]
    projected = arm.with_parameters(arm.project_parameters(arm.parameters))
    assert projected.check_parameters().consistent
    if size == 1e-7:
        with pytest.raises(al.ModelError, match="negative principal moment"):
            plate(-1.1 * size, size, size, mass=1e-3)


def test_rotors_that_are_not_identified_are_known() -> None:
    """The base parameters explain the torque of an arm, whether its rotors are identified or known."""
    arm = ARMS["six_axis"]
    assert np.all(arm.limits["armature"] > 0.0)
    q, v, a, _ = states(arm, 200, 9)
    tau = arm.inverse_dynamics(q, v, a)
    found = arm.with_parameters(1.2 * arm.parameters).identify(q, v, a, tau)
    np.testing.assert_allclose(found.values, arm.base_parameters().values, rtol=1e-10, atol=1e-11)
    assert np.all(found.residuals < 1e-10)
    np.testing.assert_allclose(found.arm.inverse_dynamics(q, v, a), tau, rtol=0.0, atol=1e-9)


def test_the_identified_arm_has_the_identified_rotors_and_friction() -> None:
    arm = ARMS["two_arms"]
    q, v, a, _ = states(arm, 300, 10)
    tau = arm.inverse_dynamics(q, v, a, friction=True)
    text, _ = arm.to_urdf()
    for drive in ("armature", "damping", "friction"):
        text = re.sub(rf'{drive}="[^"]*"', f'{drive}="0.01"', text)
    wrong = al.load_urdf(text).with_parameters(0.9 * arm.parameters)
    found = wrong.identify(q, v, a, tau, armature=True, friction=True).arm
    np.testing.assert_allclose(found.inverse_dynamics(q, v, a, friction=True), tau, rtol=0.0, atol=1e-9 * np.abs(tau).max())
    for drive in ("damping", "friction"):
        np.testing.assert_allclose(found.limits[drive], arm.limits[drive], rtol=0.0, atol=1e-9)
    only = wrong.identify(q, v, a, arm.inverse_dynamics(q, v, a) + arm.limits["damping"] * v, friction=True).arm
    np.testing.assert_array_equal(only.limits["armature"], wrong.limits["armature"])
    assert found.joint_names == arm.joint_names and found.frame_names == arm.frame_names
    np.testing.assert_array_equal(found.limits["q_min"], arm.limits["q_min"])
