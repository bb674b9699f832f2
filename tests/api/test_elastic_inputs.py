"""Invalid arguments of laws and limits of elastic joints raise an `InputError` with function, argument and expected value."""

from __future__ import annotations

import copy
import functools
import pickle
from typing import Any

import models
import numpy as np
import pytest
from refusals import refused

import armlet as al

ARM = models.TWO_LINKS
PLANT = al.ElasticArm(ARM, [800.0, 500.0], [0.4, 0.25])
INDEFINITE = np.array([[1.0, 2.0], [2.0, 1.0]])
NAN, INF = float("nan"), float("inf")
GIVEN: dict[str, Any] = {
    "arm": ARM,
    "target": [0.5, 0.3],
    "stiffness": [300.0, 200.0],
    "damping": [40.0, 30.0],
    "joint_stiffness": [800.0, 500.0],
    "motor_inertia": [0.4, 0.25],
    "reduced_inertia": [0.02, 0.0125],
    "frame": "link2",
    "axes": "xy",
}


def impedance(**changes: Any) -> al.ElasticImpedance:
    return al.ElasticImpedance(**(GIVEN | changes))


MOVING = al.Quintic([0.5, 0.3], [0.4, 0.4], 1.0)
LAWS: dict[str, al.Law] = {
    "impedance": impedance(),
    "full": impedance(motor_inertia=[[0.4, 0.05], [0.05, 0.25]], motor_damping=[[8.0, 1.0], [1.0, 5.0]], relative_damping=True),
    "ratio": impedance(damping_ratio=0.7),
    "tracking": al.ElasticTracking(ARM, al.Quintic([0.5, 0.3], [0.4, 0.4], 1.0), 300.0, 40.0, 800.0, 0.4, 0.02, frame="link2", axes="xy"),
    "joint": al.JointImpedance(ARM, [0.3, 1.0], 100.0, 10.0, 800.0, 0.4, 0.02),
    "moving": al.JointTracking(ARM, al.Quintic([0.5, 0.3], [0.4, 0.4], 1.0), 100.0, 10.0, 800.0, 0.4),
    "motor": al.MotorPD(ARM, [0.3, 1.0], 100.0, 10.0, 800.0, online=True),
    "state": al.StateFeedback(ARM, [0.3, 1.0], 100.0, 10.0, 1.0, 0.02, 800.0),
    "joint, moving": al.JointImpedance(ARM, MOVING, 100.0, 10.0, 800.0, 0.4, 0.02),
    "motor, moving": al.MotorPD(ARM, MOVING, 100.0, 10.0, 800.0, online=True),
    "state, moving": al.StateFeedback(ARM, MOVING, 100.0, 10.0, 1.0, 0.02, 800.0),
}


@pytest.mark.parametrize("name", ["stiffness", "damping", "joint_stiffness", "motor_inertia", "reduced_inertia", "motor_damping"])
def test_matrices(name: str) -> None:
    for bad, words in (
        (INDEFINITE, "is not positive definite"),
        ([1.0, -1.0], "is not positive definite"),
        (0.0, "is not positive"),
        ([[1.0, 0.5], [0.0, 1.0]], "is not symmetric"),
        ([1.0, NAN], "is not finite"),
        ([1.0, INF], "is not finite"),
        ([1.0, 1.0, 1.0], "has the wrong shape"),
    ):
        refused(functools.partial(impedance, **{name: bad}), f"ElasticImpedance: {name} {words}")


def test_other_arguments() -> None:
    refused(lambda: impedance(target=[0.5]), "target", "(2,)")
    refused(lambda: impedance(frame="hand"), "frame", "link1")
    refused(lambda: impedance(axes="xw"), "axes")
    refused(lambda: impedance(arm=models.PR), "planar_pr")
    for ratio in (0.0, -1.0, INF, NAN):
        refused(functools.partial(impedance, damping_ratio=ratio), "damping_ratio")
    refused(lambda: al.MotorPD(ARM, [0.3], 100.0, 10.0, 800.0), "MotorPD: target")
    for target in (al.Hold([0.3]), al.Quintic([0.3], [0.4], 1.0)):
        refused(lambda target=target: al.MotorPD(ARM, target, 100.0, 10.0, 800.0), "MotorPD: target", "2")
        refused(lambda target=target: al.StateFeedback(ARM, target, 100.0, 10.0, 1.0, 0.02, 800.0), "StateFeedback: target", "2")
        refused(lambda target=target: al.JointImpedance(ARM, target, 100.0, 10.0, 800.0, 0.4, 0.02), "JointImpedance: target", "2")
    refused(lambda: al.MotorPD(ARM, [0.3, NAN], 100.0, 10.0, 800.0), "MotorPD: target", "is not finite")
    refused(lambda: al.MotorPD(ARM, "rest", 100.0, 10.0, 800.0), "MotorPD: target")
    refused(lambda: al.StateFeedback(ARM, [0.3, 1.0], 100.0, 10.0, -1.0, 0.02, 800.0), "StateFeedback: kt")
    refused(lambda: al.ElasticTracking(ARM, al.Hold([0.5]), 300.0, 40.0, 800.0, 0.4, 0.02, frame="link2", axes="xy"), "shape")


def tracking(**changes: Any) -> al.JointTracking:
    given: dict[str, Any] = {"motion": al.Quintic([0.5, 0.3], [0.4, 0.4], 1.0), "kp": 100.0, "kd": 10.0} | changes
    return al.JointTracking(ARM, **{"joint_stiffness": 800.0, "motor_inertia": 0.4} | given)


def test_joint_tracking() -> None:
    for name in ("kp", "kd", "joint_stiffness", "motor_inertia"):
        refused(functools.partial(tracking, **{name: INDEFINITE}), f"JointTracking: {name} is not positive definite")
        refused(functools.partial(tracking, **{name: [1.0, NAN]}), f"JointTracking: {name} is not finite")
        refused(functools.partial(tracking, **{name: [1.0, 1.0, 1.0]}), f"JointTracking: {name} has the wrong shape")
    refused(lambda: tracking(motion=al.BangBang([0.5, 0.3], [0.4, 0.4], 1.0)), "JointTracking: motion has no jerk and snap", "jumps")
    refused(lambda: tracking(motion=al.Hold([0.5])), "JointTracking: motion", "number of joints")
    refused(lambda: tracking(motion=[0.5, 0.3]), "JointTracking: motion")
    refused(lambda: tracking()(0.0, [0.3, 1.2], [0.0, 0.0]), "theta", "missing")
    refused(lambda: al.simulate(al.RigidArm(ARM), tracking(), [0.3, 1.2], t_end=0.1, dt=1e-3), "law", "ElasticArm")
    refused(lambda: al.equilibrium(PLANT, tracking(motion=al.Hold([0.3, 1.0])), q0=[0.3, 1.0]), "equilibrium: law", "JointTracking")


def test_plants_and_calls() -> None:
    refused(lambda: al.simulate(al.RigidArm(ARM), impedance(), [0.3, 1.2], t_end=0.1, dt=1e-3), "law", "ElasticArm")
    refused(lambda: impedance()(0.0, [0.3, 1.2], [0.0, 0.0]), "theta", "missing")
    three = al.ElasticArm(models.THREE_LINKS, 800.0, 0.4)
    refused(lambda: al.simulate(three, impedance(), [0.3, 1.2, 0.0], t_end=0.1, dt=1e-3), "number of joints")


def test_equilibrium() -> None:
    law = impedance()
    refused(lambda: al.equilibrium(al.RigidArm(ARM), law, q0=[0.3, 1.2]), "equilibrium: law", "RigidArm")
    refused(lambda: al.equilibrium(PLANT, LAWS["tracking"], q0=[0.3, 1.2]), "law", "moves")
    tracked = al.ComputedTorque(ARM, al.Hold([0.3, 1.0]), 100.0, 20.0)
    refused(lambda: al.equilibrium(al.RigidArm(ARM), tracked, q0=[0.3, 1.2]), "law", "ComputedTorque")
    refused(lambda: al.equilibrium(PLANT, LAWS["joint"], [1.0, 0.0], q0=[0.3, 1.2]), "force_frame")
    refused(lambda: al.equilibrium(PLANT, law, [1.0], q0=[0.3, 1.2]), "force")
    refused(lambda: al.equilibrium(PLANT, law, [1.0, NAN], q0=[0.3, 1.2]), "force")
    refused(lambda: al.equilibrium(PLANT, law, [(0.0, [1.0, 2.0]), (1.0, [0.0, 0.0])], q0=[0.3, 1.2]), "force", "constant")
    refused(lambda: al.equilibrium(PLANT, law, q0=[0.3, INF]), "q0")
    refused(lambda: al.equilibrium(PLANT, law, q0=[0.3]), "q0")


def test_limits() -> None:
    refused(lambda: al.elastic_limits(PLANT, LAWS["motor"], q0=[0.3, 1.2]), "law", "MotorPD")
    refused(lambda: al.elastic_limits(PLANT, impedance(), q0=[0.3, 1.2], sample_time=-1.0), "sample_time")
    refused(lambda: al.elastic_limits(PLANT, impedance(), q0=[0.3, 1.2], sample_time=1e-3, sensor_bandwidth=0.0), "sensor_bandwidth")
    for k in range(3):
        numbers: list[Any] = [0.4, 800.0, 1e-3]
        numbers[k] = 0.0
        refused(functools.partial(al.smallest_reduced_inertia, *numbers), "smallest_reduced_inertia")
    refused(lambda: al.smallest_reduced_inertia([0.4, 0.3], 800.0, [1e-3, 1e-3, 1e-3]), "broadcast")
    refused(lambda: al.smallest_reduced_inertia(0.4, NAN, 1e-3), "joint_stiffness")
    refused(lambda: al.stiffness_limit(1.0, 800.0, 0.02, -1.0), "damping")
    refused(lambda: al.stiffness_limit(0.0, 800.0, 0.02, 1.0), "mass")
    refused(lambda: al.damping_from_ratio(INDEFINITE, np.eye(2), 1.0), "inertia")
    refused(lambda: al.damping_from_ratio(np.eye(2), np.eye(3), 1.0), "stiffness")
    assert np.isnan(al.smallest_reduced_inertia(0.4, 800.0, 1.0))


def test_a_divergence_ends_with_status_and_time() -> None:
    # The motors have modes of about sqrt(800/4e-8) = 1.4e5 rad/s. For them, steps of 1 ms are far too long.
    law = impedance(reduced_inertia=[4e-8, 2.5e-8])
    with pytest.raises(al.SolveError) as caught:
        al.simulate(PLANT, law, [0.3, 1.2], t_end=1.0, dt=1e-3, force=[10.0, -15.0])
    assert caught.value.status is al.Status.DIVERGED and caught.value.t is not None and 0.0 < caught.value.t < 1.0


@pytest.mark.parametrize("name", LAWS)
def test_laws_can_be_pickled_and_copied(name: str) -> None:
    law, state = LAWS[name], {"theta": [0.35, 1.2], "theta_dot": [0.1, -0.2]}
    for other in (pickle.loads(pickle.dumps(law)), copy.copy(law), copy.deepcopy(law)):
        assert type(other) is type(law) and repr(other) == repr(law)
        for part, value in law.terms(0.1, [0.3, 1.1], [0.2, 0.4], **state).items():
            np.testing.assert_array_equal(other.terms(0.1, [0.3, 1.1], [0.2, 0.4], **state)[part], value)
        np.testing.assert_array_equal(other(0.1, [0.3, 1.1], [0.2, 0.4], **state), law(0.1, [0.3, 1.1], [0.2, 0.4], **state))
    rest = al.equilibrium(PLANT, impedance(), q0=[0.3, 1.2])
    again = pickle.loads(pickle.dumps(rest))
    np.testing.assert_array_equal(again.eigenvalues, rest.eigenvalues)
