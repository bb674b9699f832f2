"""A damaged pickle of the extension raises FormatError and never gives a different object. Older pickles load or raise FormatError."""

from __future__ import annotations

import copy
import pickle
import pickletools
import resource
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet import _core

PR = al.planar_pr(2.0, 0.5, 0.25)
TREE = models.TWO_LINKS
SIX = models.SIX_AXES
TASKS = [al.Task("link2", "xy", [0.5, 0.4], 3.0)]
LINK = (0.0, 1.0, 1.0, 2.0, 5.0)
KNOTS = np.arange(6.0).reshape(3, 2)
BOUND = al.bang_bang_time(*LINK)


def simulator() -> al.Simulator:
    made = al.Simulator(al.RigidArm(PR), al.PDGravity(PR, [0.0, 0.0], 5.0, 2.0), [0.1, 0.2], dt=1e-3)
    made.step()
    return made


def joint_law(law: Any, arm: al.Arm, **keywords: Any) -> al.Law:
    made: al.Law = law(arm, [0.3] * arm.n, **keywords)
    return made


#: At least one object of every class that can be pickled.
THINGS: dict[str, Any] = {
    "Arm": PR,
    "Arm of links": TREE,
    "Arm of a file": SIX,
    "Hold": al.Hold([1.0, -0.5]),
    "Quintic": al.Quintic([0.0, 0.0], [1.0, 1.5], 3.0),
    "BangBang": al.BangBang([0.0, 0.0], [1.0, 1.5], 3.0),
    "Sinusoid": al.Sinusoid([0.0, 0.3], [0.5, 0.2], [1.0, 2.3], 0.25),
    "Table": al.Table(0.1, KNOTS, KNOTS / 3.0, KNOTS / 7.0),
    "Spline": al.Spline([0.0, 0.4, 1.0], KNOTS[:3]),
    "TimedPath": al.time_path(TREE, [[0.0, 0.0], [0.4, 0.3]], tau_max=[30.0, 20.0], v_max=2.0),
    "RigidArm": al.RigidArm(TREE, stops=al.JointStops(1e3, lower=-1.0, upper=1.0)),
    "ElasticArm": al.ElasticArm(TREE, 800.0, 0.4),
    "VelocityArm": al.VelocityArm(TREE),
    "Wall": al.Wall("link2", [0.7, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=1e4),
    "MomentumObserver": al.MomentumObserver(TREE, 40.0, threshold=0.5),
    "Guarded": al.Guarded(
        al.PDGravity(TREE, [0.3, 0.3], 40.0, 20.0), al.MomentumObserver(TREE, 40.0, threshold=0.5), "stop", stiffness=20.0, damping=3.0
    ),
    "Adaptive": al.Adaptive(PR, al.Hold([1.0, 0.0]), 40.0, 20.0, 5.0),
    "ComputedTorque": al.ComputedTorque(PR, al.Hold([1.0, 0.0]), 40.0, 20.0),
    "PDGravity": al.PDGravity(TREE, [0.3, 0.3], 40.0, 20.0),
    "PID": al.PID(TREE, [0.3, 0.3], 40.0, 10.0, 20.0, tau_max=30.0),
    "PID with options": al.PID(TREE, [0.3, 0.3], 40.0, None, 20.0, derivative_filter=90.0, friction=True, observer_bandwidth=[20.0, 30.0]),
    "CartesianImpedance": al.CartesianImpedance(TREE, [0.5, 0.4], 100.0, 20.0, frame="link2", axes="xy"),
    "CartesianImpedance with a null space": al.CartesianImpedance(
        TREE,
        al.Hold([0.5]),
        100.0,
        20.0,
        frame="link2",
        axes="x",
        nullspace=al.NullSpace([0.3, 0.3], 10.0, [[1.0, 0.1], [0.1, 1.0]], projection="static"),
        feedforward=[2.0],
        integral_gain=3.0,
        wrench_max=50.0,
        tau_max=[20.0, 10.0],
    ),
    "NullSpace": al.NullSpace([0.3, 0.3], 10.0, 2.0),
    "ElasticImpedance": al.ElasticImpedance(TREE, [0.5, 0.4], 100.0, 20.0, 800.0, 0.4, 0.02, frame="link2", axes="xy"),
    "ElasticTracking": al.ElasticTracking(TREE, al.Hold([0.5, 0.4]), 100.0, 20.0, 800.0, 0.4, 0.02, frame="link2", axes="xy"),
    "JointImpedance": al.JointImpedance(TREE, [0.3, 0.3], 100.0, 20.0, 800.0, 0.4, 0.02),
    "JointTracking": al.JointTracking(TREE, al.Quintic([0.3, 0.3], [0.5, 0.1], 1.0), 100.0, 20.0, 800.0, 0.4),
    "MotorPD": al.MotorPD(TREE, [0.3, 0.3], 100.0, 20.0, 800.0),
    "StateFeedback": al.StateFeedback(TREE, [0.3, 0.3], 100.0, 20.0, 1.0, 0.1, 800.0),
    "PriorityVelocity": al.PriorityVelocity(TREE, TASKS),
    "PriorityAcceleration": al.PriorityAcceleration(TREE, [al.Task("link2", "xy", [0.5, 0.4], 3.0, damping=2.0)]),
    "Task": TASKS[0],
    "PostureTask": al.PostureTask([0.1, 0.2], 1.0),
    "CentreOfMassTask": al.CentreOfMassTask("xy", [0.1, 0.2], 1.0),
    "AxisTask": al.AxisTask("link2", [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1.0),
    "RelativeTask": al.RelativeTask("link2", "link1", "xy", [0.1, 0.2], 1.0),
    "DistanceTask": al.DistanceTask("link2", None, 0.1, 1.0, radius=0.05, other_points=[0.4, 0.2, 0.1]),
    "JointLimitTask": al.JointLimitTask(1.0, margin=0.1),
    "PrioritySolver": al.PrioritySolver(3, [1, 1]),
    "ArmPrioritySolver": al.PrioritySolver.for_arm(TREE, TASKS),
    "PrioritySolution": al.solve_priority([np.ones((1, 2))], [np.ones(1)]),
    "PrioritySolution with bounds": al.solve_priority([np.ones((1, 2))], [np.ones(1)], v_max=0.3),
    "Within": al.Within([-1.0, -np.inf], [1.0, 0.5]),
    "LimitHold": al.LimitHold("joint 1", "upper", 1, 0.0, 1.5),
    "Active": al.solve_priority([[[1.0]]], [[3.0]], v_max=2.0).limits[0],
    "InverseKinematics": al.inverse_kinematics(TREE, TASKS, [0.3, 0.4]),
    "BangBangReport": BOUND,
    "Bind": BOUND.active_upper,
    "BangBangBatch": al.bang_bang_time(0.0, [1.0, 0.5], 1.0, 2.0, 5.0),
    "ProfileReport": al.minimum_jerk_time(*LINK),
    "ProfileReport with ramps": al.trapezoid_time(*LINK, ramp=0.3),
    "TorqueOptimum": al.torque_optimal_time(*LINK),
    "Best": al.torque_optimal_time(*LINK).best,
    "SuggestedGains": al.suggest_gains(TREE, 10.0, sample_time=1e-4),
    "Simulator": simulator(),
}
SCENARIO = al.Scenario(
    {
        "arm": {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5},
        "motion": {"kind": "Hold", "q": [1.0, 0.0]},
        "law": {"kind": "ComputedTorque", "kp": 100.0, "kd": 20.0},
        "run": {"q0": [0.0, 0.0], "t_end": 0.002, "dt": 1e-3},
    }
)
RUN = al.simulate(
    al.RigidArm(TREE), al.PDGravity(TREE, [0.3, 0.3], 40.0, 20.0), [0.0, 0.0], t_end=0.01, method="dopri5", dense=True,
    events=[al.Event.joint(0, 1e-4)],
)  # fmt: skip
SRDF = al.load_srdf('<robot><group name="arm"><joint name="j"/></group></robot>')
ODE = al.integrate(lambda t, y: -y, (0.0, 1.0), [1.0], dense_output=True)
DRIVEN = np.random.default_rng(1).normal(size=(4, 30, 2))
TIMES = np.arange(800) * 0.01
MOVED = al.Sinusoid([0.1, 0.2], [0.5, 0.7], [3.0, 2.0], [0.0, 0.3])(TIMES)
LOG = al.Log(TIMES, MOVED[0], v=MOVED[1], tau=TREE.inverse_dynamics(*MOVED), names=TREE.joint_names)
#: Objects of classes that are written in Python.
PYTHON: dict[str, Any] = {
    "Run": RUN,
    "BatchRun": al.simulate_batch(al.RigidArm(PR), THINGS["ComputedTorque"], np.zeros((2, 2)), t_end=0.01, dt=1e-3),
    "Metrics": RUN.metrics(),
    "LoopProgram": al.loop_program(al.RigidArm(PR), THINGS["ComputedTorque"], method="euler"),
    "Event": al.Event.plane("link2", [0.6, 0.0, 0.0], [1.0, 0.0, 0.0], direction=1),
    "Events": RUN.events,
    "State": RUN.sample(0.005),
    "JointStops": al.JointStops(1e3, lower=-1.0, upper=1.0),
    "Sensitivity": al.Sensitivity("law.kp", (2,), np.arange(2.0), *np.random.default_rng(2).normal(size=(3, 2, 2, 2))),
    "CartesianPath": al.CartesianPath(np.linspace(0.0, 1.0, 5), np.ones((5, 2)), [1e-5, 2e-5], [0, 4], 0.5, None),
    "Srdf": SRDF,
    "SrdfGroup": SRDF.groups["arm"],
    "Sampling": al.Sampling(1e-3, noise={"q": 1e-3}, torque_sensor=al.TorqueSensor(bias=[0.1, 0.2])),
    "TorqueSensor": al.TorqueSensor(bias=[0.1, 0.2]),
    "Scenario": SCENARIO,
    "SweepTable": al.sweep(SCENARIO, {"law.kp": [50.0, 100.0]}),
    "Tuning": al.tune(SCENARIO, {"law.kp": {"uniform": [1.0, 2.0]}}, "error_rms1", candidates=5, generations=0),
    "WorstCase": al.worst_case(SCENARIO, {"law.kp": {"uniform": [1.0, 2.0]}}, "error_rms", runs=8),
    "Verification": al.Verification((), ("none",)),
    "Integration": ODE,
    "DenseOutput": ODE.dense,
    "PriorityDiagnosis": al.diagnose_priority([np.ones((1, 2))]),
    "Equilibrium": al.equilibrium(al.RigidArm(TREE), THINGS["PDGravity"], q0=[0.1, 0.1]),
    "ElasticLimits": al.elastic_limits(THINGS["ElasticArm"], THINGS["ElasticImpedance"], q0=[0.3, 1.0]),
    "LoopMargins": al.loop_margins(PR, THINGS["ComputedTorque"], [0.0, 0.0]),
    "BaseParameters": TREE.base_parameters(),
    "ParameterReport": TREE.check_parameters(TREE.parameters),
    "Identification": TREE.identify(*DRIVEN),
    "Log": LOG,
    "LogReport": LOG.report,
    "LogFit": al.fit_log(TREE, LOG, ["inertia"]),
    "Refuted": al.Refuted("delay", None, 1e-4, 9.0, 0.5, "the torques act 5 ms later than assumed", "pass delay=0.005"),
    "LuGre": al.LuGre(coulomb=1.0, static=[1.5, 2.0], stribeck_speed=0.05, stiffness=1e4),
    "StickSlip": al.StickSlip(coulomb=1.0, load_ratio=0.1),
    "Contact": al.Contact(time=0.25, joint=1, residual=np.array([2.0, 3.0])),
    "Samples": al.Samples(W=np.ones((1, 2, 3)), tau=np.ones((1, 2)), indices=np.array([0]), singular_value=1.0, rank=1),
    "RunIdentification": al.RunIdentification(
        values={"law.kp": np.ones(2)},
        deviations={"law.kp": np.ones(2)},
        covariance=np.eye(2),
        rank=2,
        condition=3.0,
        residuals={"q": np.zeros(2)},
        plant=THINGS["RigidArm"],
        laws=(THINGS["PDGravity"],),
        runs=(RUN,),
        iterations=4,
        converged=True,
    ),
    "ExcitingMotion": al.ExcitingMotion([0.0], [[0.5, 0.2]], [[1.0, 2.0]], [[0.3, 0.1]], 6.0, 3.5, [0.1, 0.2]),
}
EVERY = THINGS | PYTHON
each = pytest.mark.parametrize("thing", EVERY.values(), ids=EVERY.keys())


def payload(thing: Any) -> tuple[bytes, range]:
    """The pickle, and the range of the bytes of its only payload."""
    stored = pickle.dumps(thing, 4)
    ((argument, at),) = [(arg, pos) for op, arg, pos in pickletools.genops(stored) if op.name in ("SHORT_BINBYTES", "BINBYTES")]
    start = stored.index(argument, at)
    assert len(stored) - len(argument) < 80  # names and opcodes of pickle
    return stored, range(start, start + len(argument))


def test_every_class_that_pickles_is_here() -> None:
    """Every class is in the list above, or its objects cannot be pickled."""
    classes = {name for name, value in vars(_core).items() if isinstance(value, type)}
    listed = {type(thing).__name__ for thing in THINGS.values()}
    assert classes - listed == {"Law", "Motion", "Plant", "Stepper", "_BatchStepper"}
    public = {name for name in al.__all__ if isinstance(getattr(al, name), type) and getattr(al, name).__module__ != "armlet._core"}
    listed = {type(thing).__name__ for thing in EVERY.values()}
    # The other classes have no payload: errors consist of texts, and a status is a number.
    assert {name for name in public - listed if not issubclass(getattr(al, name), Exception)} == {"Law", "Motion", "Plant", "Status"}


@each
def test_objects_are_restored_from_pickles_and_copies(thing: Any) -> None:
    for other in (pickle.loads(pickle.dumps(thing)), copy.copy(thing), copy.deepcopy(thing)):
        assert type(other) is type(thing) and repr(other) == repr(thing)


@each
def test_a_flipped_bit_is_noticed(thing: Any) -> None:
    """In a short payload one bit of every byte is flipped. In a long payload one bit of each of 400 bytes is flipped."""
    stored, inside = payload(thing)
    places = np.unique(np.linspace(inside[0], inside[-1], 400).astype(int))
    for k, place in enumerate(places):
        damaged = bytearray(stored)
        damaged[place] ^= 1 << (k % 8)
        with pytest.raises(al.FormatError, match=r"^unpickle: the stored object is damaged"):
            pickle.loads(bytes(damaged))


@pytest.fixture
def little_memory() -> Iterator[None]:
    """Limit the memory to 1 GB above the present use. pickle would read a flipped opcode as a memo of 64 GB and allocate it."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + (1 << 30), before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.mark.parametrize("thing", [PR, TREE, THINGS["ComputedTorque"]], ids=["planar_pr", "tree", "law"])
def test_no_flipped_bit_gives_another_object(thing: Any, little_memory: None) -> None:
    """After any single flipped bit, also in opcodes of pickle, the result is an error, an equal object, or an object of another class."""
    stored = pickle.dumps(thing, 4)
    same = 0
    for place in range(len(stored)):
        for bit in range(8):
            damaged = bytearray(stored)
            damaged[place] ^= 1 << bit
            try:
                other = pickle.loads(bytes(damaged))
            except Exception:  # FormatError of the payload, or an error of pickle
                continue
            same += 1
            assert repr(other) == repr(thing) or not isinstance(other, type(thing))
    # A change of the protocol number, the frame length or a memo may have no effect.
    assert same < 60


def test_a_truncated_or_invalid_payload() -> None:
    whole = pickle.loads(pickle.dumps(PR)).__reduce__()[1][0]
    for part in (b"", whole[:31], whole[:-1], whole + b"\0", "text", None, 3):
        with pytest.raises(al.FormatError, match="damaged"):
            _core._restore(part)  # type: ignore[arg-type]  # invalid arguments


def test_pickles_of_another_version_are_refused() -> None:
    import hashlib

    body = pickle.dumps((al.planar_pr, (1.0, 0.0, -1.0), {}))
    with pytest.raises(al.FormatError, match=r"is of another version: InputError: planar_pr: C"):
        _core._restore(hashlib.sha256(body).digest() + body)


@pytest.mark.parametrize("place", ["armlet.run_metrics\nMetrics", "armlet.events\nJointStops", "armlet.sampling\nSampling"])
def test_pickles_of_a_renamed_module_are_refused(place: str) -> None:
    import hashlib

    body = b"(c" + place.encode() + b"\n)}t."
    with pytest.raises(al.FormatError, match=r"is of another version: ModuleNotFoundError: No module named 'armlet\.\w+'"):
        _core._restore(hashlib.sha256(body).digest() + body)


class Older:
    """Pickles in the form of armlet 0.1: a function or a class, and its arguments."""

    def __init__(self, make: Any, *arguments: Any) -> None:
        self.call = make, arguments

    def __reduce__(self) -> Any:
        return self.call


def test_older_pickles_load() -> None:
    parts = PR.parameters.tolist()
    assert pickle.loads(pickle.dumps(Older(_core._restore_planar_pr, parts))) == PR
    function, arguments, _ = pickle.loads(SIX.__reduce__()[1][0][32:])
    assert pickle.loads(pickle.dumps(Older(function, *arguments))) == SIX
    assert pickle.loads(pickle.dumps(Older(_core._restore_plan, "bang_bang_time", (*LINK, -5.0)))) == BOUND


def test_a_simulator_with_a_law_in_python_can_be_copied() -> None:
    sim = al.Simulator(al.RigidArm(PR), lambda t, q, v: -5.0 * q - 2.0 * v, [0.1, 0.2], dt=1e-3, sample_time=1e-3)
    sim.step()
    for other in (copy.copy(sim), copy.deepcopy(sim)):
        other.step()
        assert other.t == 2e-3 and sim.t == 1e-3 and other.q is not sim.q
