"""Guarded laws: residual r_dot = K (tau_ext - r) in every run, samples equal to a separate observer, reactions, invalid arguments."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]
SIX = models.SIX_AXES
TWO = models.TWO_HEAVY_LINKS
TREE = al.load_urdf(al.example_urdf("two_arms"))
TARGET = [0.4, 0.6]
STOP: dict[str, Any] = {"reaction": "stop", "stiffness": 200.0, "damping": 30.0}
RETRACT: dict[str, Any] = {"reaction": "retract", "stiffness": 400.0, "damping": 40.0, "speed": 0.5, "duration": 0.2}
PUSH: dict[str, Any] = {"force": [(0.0, [0.0, 0.0, 0.0]), (0.1, [6.0, -4.0, 0.0])], "force_frame": "link2"}


def held(arm: al.Arm = TWO, target: Any = TARGET) -> al.PDGravity:
    return al.PDGravity(arm, target, 60.0, 15.0)


def guarded(gain: Any = 50.0, threshold: float = 1.0, **keywords: Any) -> al.Guarded:
    return al.Guarded(held(), al.MomentumObserver(TWO, gain, threshold=threshold), **keywords)


@pytest.mark.parametrize("arm", [TWO, SIX], ids=["2R", "six axes"])
@pytest.mark.parametrize("inner", ["PDGravity", "Adaptive"])
def test_the_residual_is_the_filtered_torque_from_outside(arm: al.Arm, inner: str) -> None:
    """In continuous runs under a wrench, r + K int r = K int tau_ext. The run integrates r, and Simpson's rule integrates tau_ext.

    The error of Simpson's rule is (0.2 ms)^4/180 times the fourth derivative of the torque.
    """
    n, frame = arm.n, arm.frame_names[-1]
    rng = np.random.default_rng(n)
    root = rng.standard_normal((n, n))
    K = 20.0 * (root @ root.T / n + 0.5 * np.eye(n))
    target = rng.uniform(-0.3, 0.3, n)
    law: al.Law = held(arm, target)
    if inner == "Adaptive":
        law = al.Adaptive(arm, al.Hold(target), 60.0, 15.0, 0.01, estimate=arm.parameters)
    watched = al.Guarded(law, al.MomentumObserver(arm, K))
    wrench = np.array([8.0, -5.0, 3.0, 0.4, -0.2, 0.3])
    t = np.linspace(0.0, 1.0, 5001)
    options: dict[str, Any] = {"t_end": 1.0, "t_eval": t, "method": "dop853", "rtol": 1e-12, "atol": 1e-12, "check_limits": False}
    run = al.simulate(al.RigidArm(arm), watched, np.zeros(n), force=wrench, force_frame=frame, **options)
    assert run.residual is not None and run.estimate is not None
    outside = np.einsum("kji,j->ki", arm.jacobian(run.q, frame), wrench)
    # Simpson's rule over pairs of steps gives the integral at every second record.
    spans = (outside[:-2:2] + 4.0 * outside[1:-1:2] + outside[2::2]) / 15000.0
    impulse = np.concatenate([np.zeros((1, n)), np.cumsum(spans, axis=0)])
    summed = run.estimate[::2, watched._first + n : watched._first + 2 * n]
    np.testing.assert_allclose(run.residual[::2], (impulse - summed) @ K.T, rtol=0, atol=1e-9)
    assert np.abs(run.residual[-1]).max() > 1.0


@pytest.mark.parametrize("gain", [40.0, [30.0, 60.0], [[40.0, 10.0], [10.0, 50.0]], 5000.0], ids=str)
def test_a_sampled_loop_has_the_samples_of_the_observer(gain: Any) -> None:
    """The loop's observer equals `MomentumObserver.update` along the records: both solve one implicit equation, up to rounding."""
    dt = 1e-3
    run = al.simulate(al.RigidArm(TWO), guarded(gain), [0.2, 0.3], t_end=0.4, sample_time=dt, tau_max=[20.0, 12.0], **PUSH)
    assert run.residual is not None and run.tau is not None
    observer = al.MomentumObserver(TWO, gain)
    observer.reset(run.q[0], run.v[0])
    for k in range(1, len(run.t) - 1):
        r = observer.update(run.q[k], run.v[k], run.tau[k - 1], dt)
        # A record is one sample after its residual. The division by 1 ms amplifies rounding. The residuals agree to 4e-13 N m.
        np.testing.assert_allclose(run.residual[k + 1], r, rtol=0, atol=1e-10)
    assert np.abs(run.residual).max() > 1.0


@pytest.mark.parametrize("late", [{"delay": 1e-3}, {"delay": 2.5e-3}, {"rate_limit": 100.0}, {"delay": 1e-3, "rate_limit": 100.0}], ids=str)
def test_the_observer_integrates_the_torque_that_acts(late: dict[str, float]) -> None:
    """With a delay or a rate limit, the loop's observer equals `MomentumObserver.update` with the mean torque on the arm."""
    dt, parts = 1e-3, 2
    options: dict[str, Any] = {"t_end": 0.3, "dt": dt / parts, "sample_time": al.Sampling(dt, **late), **PUSH}
    run = al.simulate(al.RigidArm(TWO), guarded(40.0), [0.2, 0.3], **options)
    assert run.residual is not None and run.tau is not None
    observer = al.MomentumObserver(TWO, 40.0)
    observer.reset(run.q[0], run.v[0])
    for k in range(parts, len(run.t) - parts, parts):
        r = observer.update(run.q[k], run.v[k], run.tau[k - parts : k].mean(axis=0), dt)
        np.testing.assert_allclose(run.residual[k + parts], r, rtol=0, atol=1e-9)
    assert np.abs(run.residual).max() > 1.0


def test_limits_of_the_input_are_no_contact() -> None:
    """The law's torque exceeds the limits. The observer receives the limited torque, so it reports no contact."""
    law = al.Guarded(al.PDGravity(TWO, [1.5, -1.0], 400.0, 20.0), al.MomentumObserver(TWO, 50.0, threshold=0.2), **STOP)
    run = al.simulate(al.RigidArm(TWO), law, [0.0, 0.0], t_end=1.0, sample_time=1e-3, tau_max=45.0)
    assert run.tau is not None and np.abs(run.tau).max() == 45.0
    assert run.contact is None and run.residual is not None and np.abs(run.residual).max() < 0.2


def test_the_reaction_begins_at_the_first_sample_above_the_threshold() -> None:
    observed = al.simulate(al.RigidArm(TWO), guarded(), TARGET, t_end=0.3, sample_time=1e-3, **PUSH)
    run = al.simulate(al.RigidArm(TWO), guarded(**STOP), TARGET, t_end=0.3, sample_time=1e-3, **PUSH)
    assert observed.residual is not None and observed.contact is None and run.contact is not None and run.touched is not None
    above = int(np.flatnonzero(np.abs(observed.residual).max(axis=1) > 1.0)[0])
    # The residual of an interval is that of the sample at its start.
    np.testing.assert_allclose(run.contact.time, observed.t[above - 1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.contact.residual, observed.residual[above], rtol=0, atol=1e-9)
    assert run.contact.joint == run.touched[above] and (run.touched[:above] == -1).all()
    assert run.touched[-1] == 1  # a force at the tip loads the outermost joint
    np.testing.assert_array_equal(run.q[: above - 1], observed.q[: above - 1])
    assert run.stats["engine"] == al.build_info()["programs"]


def at_contact(run: al.Run) -> int:
    assert run.contact is not None
    return int(np.argmin(np.abs(run.t - run.contact.time)))


def test_stop_holds_the_position_at_contact() -> None:
    run = al.simulate(al.RigidArm(TWO), guarded(**STOP), [0.2, 0.3], t_end=4.0, sample_time=1e-3, **PUSH)
    k = at_contact(run)
    torque = TWO.jacobian(run.q[-1], "link2")[:3].T @ [6.0, -4.0, 0.0]
    # At rest the stiffness balances the load.
    np.testing.assert_allclose(200.0 * (run.q[-1] - run.q[k]), torque, atol=1e-6)
    assert np.abs(run.v[-1]).max() < 1e-6


def test_float_compensates_only_gravity() -> None:
    arm = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], gravity=[0.0, -9.81])
    law = al.Guarded(held(arm), al.MomentumObserver(arm, 50.0, threshold=1.0), "float")
    run = al.simulate(al.RigidArm(arm), law, [0.2, 0.3], t_end=0.6, dt=2.5e-4, sample_time=1e-3, record_every=4, **PUSH)
    k = at_contact(run)
    assert run.tau is not None
    np.testing.assert_allclose(run.tau[k:-1], arm.gravity(run.q[k:-1]), rtol=0, atol=1e-9)


def test_retract_moves_along_the_residual_and_then_holds() -> None:
    tap: dict[str, Any] = PUSH | {"force": [(0.0, [0.0, 0.0, 0.0]), (0.1, [6.0, -4.0, 0.0]), (0.15, [0.0, 0.0, 0.0])]}
    run = al.simulate(al.RigidArm(TWO), guarded(**RETRACT), TARGET, t_end=3.0, sample_time=1e-3, **tap)
    k = at_contact(run)
    assert run.contact is not None
    r = run.contact.residual
    # The fastest joint moves with 0.5 rad/s for 0.2 s.
    np.testing.assert_allclose(run.q[-1] - run.q[k], 0.1 * r / np.abs(r).max(), rtol=0, atol=1e-6)
    moved = TWO.position(run.q[-1], "link2") - TWO.position(run.q[k], "link2")
    assert moved @ [6.0, -4.0, 0.0] > 0.0


def test_retract_has_its_velocity_at_the_sample_of_contact() -> None:
    """The torque is g + D_c (V r_c / max |r_c| - v), with the residual r_c = K (p - w) of this sample."""
    law = guarded(gain=50.0, **RETRACT)
    q, v, r = np.array([0.3, 0.8]), np.array([0.2, -0.1]), np.array([3.0, -6.0])
    state = np.zeros(10)  # w, the integral of r, and the state of the reaction
    state[:2] = TWO.mass_matrix(q) @ v - r / 50.0
    wanted = TWO.gravity(q) + 40.0 * (0.5 * r / 6.0 - v)
    np.testing.assert_allclose(law(0.0, q, v, state=state), wanted, rtol=0, atol=1e-9)
    assert law.terms(0.0, q, v, state=state)["reacting"][0] == 1.0


def test_a_wall_is_hit_less_hard_with_a_reaction() -> None:
    motion = al.Quintic([0.9, -1.4], [0.4, -0.3], 1.0)
    tip = TWO.position(motion(0.5)[0], "link2")
    plant = al.RigidArm(TWO, wall=al.Wall("link2", tip, [-1.0, 0.0, 0.0], stiffness=2e4, damping=50.0))
    observer = al.MomentumObserver(TWO, 80.0, threshold=0.5)
    final, peak = {}, {}
    for name, keywords in {"none": {}, "stop": STOP, "float": {"reaction": "float", "damping": 3.0}, "retract": RETRACT}.items():
        law = al.Guarded(al.ComputedTorque(TWO, motion, 400.0, 40.0), observer, **keywords)
        run = al.simulate(plant, law, motion(0.0)[0], t_end=1.5, dt=2e-4, sample_time=1e-3, record_every=5)
        assert run.contact_force is not None
        assert (run.contact is None) == (name == "none")
        final[name], peak[name] = run.contact_force[-1], run.contact_force.max()
    assert final["retract"] == 0.0 and final["stop"] < 0.2 * final["none"] and final["float"] < 0.2 * final["none"]
    assert max(peak["stop"], peak["float"], peak["retract"]) < peak["none"]


def test_elastic_joints_are_observed_by_their_torque() -> None:
    """A force F pushes the tip. At rest the residual is J'F, and so is the stiffness of "stop" times the motors' motion since contact."""
    stiffness, motors = np.array([900.0, 700.0]), np.array([0.4, 0.3])
    plant = al.ElasticArm(TWO, stiffness, motors)
    inner = al.MotorPD(TWO, TARGET, 300.0, 40.0, stiffness)
    law = al.Guarded(inner, al.MomentumObserver(TWO, 50.0, threshold=0.6), **STOP)
    run = al.simulate(plant, law, TARGET, t_end=3.0, dt=5e-4, sample_time=1e-3, record_every=2, **PUSH)
    k = at_contact(run)
    assert run.theta is not None and run.residual is not None
    torque = TWO.jacobian(run.q[-1], "link2")[:3].T @ [6.0, -4.0, 0.0]
    np.testing.assert_allclose(run.residual[-1], torque, atol=1e-3)
    np.testing.assert_allclose(200.0 * (run.theta[-1] - run.theta[k]), torque, atol=1e-2)


def test_a_stiffness_that_is_stated_is_that_of_the_law() -> None:
    stiffness, motors = np.array([900.0, 700.0]), np.array([0.4, 0.3])
    inner = al.MotorPD(TWO, TARGET, 300.0, 40.0, stiffness)
    runs = [
        al.simulate(
            al.ElasticArm(TWO, stiffness, motors),
            al.Guarded(inner, al.MomentumObserver(TWO, 50.0, threshold=0.6), joint_stiffness=given, **STOP),
            TARGET,
            t_end=0.2,
            dt=5e-4,
            sample_time=1e-3,
            **PUSH,
        )
        for given in (None, stiffness, 0.5 * stiffness)
    ]
    np.testing.assert_array_equal(runs[1].estimate, runs[0].estimate)
    assert runs[2].estimate is not None and np.abs(runs[2].estimate - runs[0].estimate).max() > 0.01


@pytest.mark.parametrize("keywords", [{}, STOP, {"reaction": "float"}, RETRACT], ids=lambda x: x.get("reaction", "none"))
def test_rows_of_a_batch_are_runs(keywords: dict[str, Any]) -> None:
    sampling = al.Sampling(1e-3, noise={"v": 1e-3}, delay=1e-3, seed=5)
    laws = [guarded(threshold=threshold, **keywords) for threshold in (0.8, 1.2, 50.0)]
    options: dict[str, Any] = {"t_end": 0.3, "dt": 1e-3, **PUSH}
    batch = al.simulate_batch(al.RigidArm(TWO), laws, np.tile(TARGET, (3, 1)), sample_time=sampling, **options)
    last = al.simulate_batch(al.RigidArm(TWO), laws, np.tile(TARGET, (3, 1)), sample_time=sampling, keep="final", **options)
    assert batch.residual is not None and batch.touched is not None and last.residual is None
    for row, law in enumerate(laws):
        seeded = al.Sampling(1e-3, noise={"v": 1e-3}, delay=1e-3, seed=5 + row)
        run = al.simulate(al.RigidArm(TWO), law, TARGET, sample_time=seeded, **options)
        assert run.residual is not None
        np.testing.assert_allclose(batch.q[row], run.q, rtol=0, atol=1e-12)
        np.testing.assert_allclose(batch.residual[row], run.residual, rtol=0, atol=1e-8)
        np.testing.assert_array_equal(batch[row].residual, batch.residual[row])
        if keywords:
            assert batch.contact is not None and last.contact is not None
            expected = np.nan if run.contact is None else run.contact.time
            np.testing.assert_allclose([batch.contact.time[row], last.contact.time[row]], expected, atol=1e-9)
            assert batch.contact.joint[row] == (-1 if run.contact is None else run.contact.joint)
            assert (run.contact is None) == (row == 2)
        else:
            assert batch.contact is None


def test_a_simulator_reacts_as_a_run_does() -> None:
    law = guarded(**STOP)
    # The force is constant. If it jumped, `simulate` would divide a step and `Simulator` would not.
    push: dict[str, Any] = {"force": [6.0, -4.0, 0.0], "force_frame": "link2", "sample_time": 1e-3}
    run = al.simulate(al.RigidArm(TWO), law, TARGET, t_end=0.3, **push)
    sim = al.Simulator(al.RigidArm(TWO), law, TARGET, dt=1e-3, **push)
    assert run.contact is not None and 0.0 < run.contact.time < 0.1
    for _ in range(300):
        sim.step()
    assert run.estimate is not None
    np.testing.assert_allclose(sim.q, run.q[-1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(sim.state["estimate"], run.estimate[-1], rtol=0, atol=1e-11)
    # `set_state` resets the observer, so the momentum of the new state is not a contact.
    free = al.Simulator(al.RigidArm(TWO), guarded(threshold=0.3, **STOP), TARGET, dt=1e-3, sample_time=1e-3)
    free.set_state([0.3, 0.2], [2.0, -1.0])
    for _ in range(50):
        free.step()
    assert free.state["estimate"][4] == 0.0


def test_the_touched_link_of_a_tree() -> None:
    observer = al.MomentumObserver(TREE, 100.0, threshold=1e-3)
    law = al.Guarded(al.PDGravity(TREE, np.full(TREE.n, 0.3), 60.0, 15.0), observer)
    options: dict[str, Any] = {"t_end": 0.2, "dt": 5e-4, "sample_time": 5e-4, "check_limits": False}
    for frame in (TREE.frame_names[-1], TREE.frame_names[2]):
        run = al.simulate(al.RigidArm(TREE), law, np.full(TREE.n, 0.3), force=[3.0, 2.0, -4.0], force_frame=frame, **options)
        assert run.touched is not None and run.residual is not None
        loaded = np.abs(TREE.jacobian(run.q[-1], frame)[:3].T @ [3.0, 2.0, -4.0]) > 1e-2
        assert loaded[run.touched[-1]]


def test_files_and_copies_keep_residual_and_contact(tmp_path: Path) -> None:
    law = guarded(**STOP)
    run = al.simulate(al.RigidArm(TWO), law, TARGET, t_end=0.3, sample_time=1e-3, **PUSH)
    run.save(tmp_path / "run.npz")
    again = al.load(tmp_path / "run.npz")
    for each in (again, pickle.loads(pickle.dumps(run))):
        np.testing.assert_array_equal(each.residual, run.residual)
        np.testing.assert_array_equal(each.touched, run.touched)
        assert each.contact is not None and run.contact is not None and each.contact.time == run.contact.time
    for other in (pickle.loads(pickle.dumps(law)), copy.copy(law), copy.deepcopy(law)):
        assert other.reaction == "stop" and other.observer.threshold.tolist() == [1.0, 1.0]
        same = al.simulate(al.RigidArm(TWO), other, TARGET, t_end=0.3, sample_time=1e-3, **PUSH)
        np.testing.assert_array_equal(same.q, run.q)
    assert repr(law).startswith("Guarded(PDGravity(") and "reaction='stop', stiffness=200.0" in repr(law)
    assert run.plot().size > 0


def test_calls_and_terms_of_a_guarded_law() -> None:
    law = guarded(**STOP)
    np.testing.assert_allclose(law(0.0, [0.2, 0.1], [0.3, -0.2]), law.law(0.0, [0.2, 0.1], [0.3, -0.2]), atol=1e-12)
    assert law.terms(0.0, [0.2, 0.1], [0.3, -0.2])["reacting"] == 0.0
    assert law.motion is None and law.reaction == "stop" and al.Guarded(held(), al.MomentumObserver(TWO, 50.0)).reaction is None
    run = al.simulate(al.RigidArm(TWO), law, TARGET, t_end=0.01, sample_time=1e-3)
    np.testing.assert_array_equal(run.target, TARGET)


def test_scenarios_have_the_keys() -> None:
    law: dict[str, Any] = {"kind": "Guarded", **STOP, "law": {"kind": "PDGravity", "target": TARGET, "kp": 60.0, "kd": 15.0}}
    law["observer"] = {"gain": 50.0, "threshold": 1.0}
    run: dict[str, Any] = {"q0": TARGET, "t_end": 0.3, "sample_time": 1e-3, "force_frame": "link2"}
    run["force"] = [{"t": 0.0, "force": [0.0, 0.0, 0.0]}, {"t": 0.1, "force": [6.0, -4.0, 0.0]}]
    data = {"arm": {"kind": "planar_arm", "lengths": [0.5, 0.4], "masses": [3.0, 2.0]}, "law": law, "run": run}
    own = al.simulate(al.RigidArm(TWO), guarded(**STOP), TARGET, t_end=0.3, sample_time=1e-3, **PUSH)
    np.testing.assert_array_equal(al.Scenario(data).run().q, own.q)
    tracking = law | {"law": {"kind": "ComputedTorque", "kp": 100.0, "kd": 20.0}}
    with pytest.raises(al.InputError, match=r"\$\.motion: is missing: the law ComputedTorque follows one"):
        al.Scenario(data | {"law": tracking})
    moved = al.Scenario(data | {"law": tracking, "motion": {"kind": "Hold", "q": TARGET}}).run()
    assert moved.contact is not None
    elastic = law | {"law": {"kind": "MotorPD", "target": TARGET, "kp": 300.0, "kd": 40.0}}
    plant = {"kind": "ElasticArm", "stiffness": 900.0, "motor_inertia": 0.4}
    assert al.Scenario(data | {"law": elastic, "plant": plant}).run().contact is not None
    with pytest.raises(al.InputError, match=r"\$\.law\.law\.joint_stiffness: is missing"):
        al.Scenario(data | {"law": elastic})
    with pytest.raises(al.InputError, match=r"\$\.law\.observer\.gain: is missing"):
        al.Scenario(data | {"law": law | {"observer": {}}})


WATCH = al.MomentumObserver(TWO, 50.0, threshold=1.0)


@pytest.mark.parametrize(
    ("arguments", "keywords", "message"),
    [
        ((3.0, WATCH), {}, "law is of the wrong type"),
        ((held(), 3.0), {}, "observer is of the wrong type"),
        ((held(), al.MomentumObserver(TWO, 50.0)), STOP, "observer has no threshold"),
        ((held(), al.MomentumObserver(SIX, 50.0, threshold=1.0)), STOP, "observer has the wrong number of joints: expected 2, got 6"),
        ((held(), al.MomentumObserver(TWO, 50.0, motor_inertia=0.1, threshold=1.0)), {}, "observer is one of motors"),
        ((held(), WATCH, "flee"), {}, "reaction is unknown: expected 'stop', 'float', 'retract' or None, got \"flee\""),
        ((held(), WATCH, "stop"), {"damping": 3.0}, "stiffness is missing"),
        ((held(), WATCH, "stop"), {"stiffness": 3.0}, "damping is missing"),
        ((held(), WATCH, "stop"), {"stiffness": 3.0, "damping": 1.0, "speed": 1.0}, "speed is not used"),
        ((held(), WATCH, "float"), {"stiffness": 3.0}, "stiffness is not used"),
        ((held(), WATCH), {"damping": 3.0}, "damping is not used"),
        ((held(), WATCH), STOP | {"stiffness": [1.0, -1.0]}, "stiffness is not positive definite.*first bad index 1"),
        ((held(), WATCH), STOP | {"damping": np.nan}, "damping is not finite"),
        ((held(), WATCH), RETRACT | {"speed": 0.0}, "speed is not positive"),
        ((held(), WATCH), RETRACT | {"duration": np.inf}, "duration is not"),
        ((held(), WATCH), {"joint_stiffness": 3.0}, "joint_stiffness is not used"),
        ((al.PriorityVelocity(TWO, [al.Task("link2", "xy", [0.5, 0.2], 3.0)]), WATCH), {}, "law cannot be guarded"),
        ((guarded(), WATCH), {}, "law cannot be guarded.*one that is guarded"),
    ],
)
def test_bad_arguments(arguments: tuple[Any, ...], keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        al.Guarded(*arguments, **keywords)


def test_bad_runs_and_residuals() -> None:
    with pytest.raises(al.InputError, match="sample_time is missing: expected the period at which Guarded looks for contact"):
        al.simulate(al.RigidArm(TWO), guarded(**STOP), TARGET, t_end=0.1, dt=1e-3)
    with pytest.raises(al.InputError, match="law is made for another plant"):
        al.simulate(al.VelocityArm(TWO), guarded(), TARGET, t_end=0.1, dt=1e-3)
    with pytest.raises(al.InputError, match="Simulator: law is made for another plant"):
        al.Simulator(al.VelocityArm(TWO), guarded(), TARGET, dt=1e-3)
    law = guarded()
    for residual, message in (([1.0], "residual"), ([np.nan, 1.0], "residual is not finite"), ([[1.0, 2.0, 3.0]], "residual")):
        with pytest.raises(al.InputError, match=message):
            law.touched(residual)
    with pytest.raises(al.InputError, match="threshold is missing"):
        al.Guarded(held(), al.MomentumObserver(TWO, 50.0)).touched([1.0, 2.0])
