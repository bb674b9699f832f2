"""Every public object can be pickled, copied and printed. The copy computes equal bits."""

from __future__ import annotations

import copy
import pickle
import pickletools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import armlet as al

ARM = al.planar_pr(2.0, 0.5, 0.25)
KNOTS = np.arange(6.0).reshape(3, 2)
MOTIONS = [
    al.Hold([1.0, -0.5]),
    al.Quintic([0.0, 0.0], [1.0, 1.5], 3.0),
    al.BangBang([0.0, 0.0], [1.0, 1.5], 3.0),
    al.Sinusoid([0.0, 0.3], [[0.5, 0.2], [0.8, 0.3]], [[1.0, 2.3], [1.7, 0.6]], 0.25),
    al.Table(0.1, KNOTS, KNOTS / 3.0, KNOTS / 7.0, start=0.05),
    al.Spline([0.1, 0.2, 0.5], KNOTS, spline="natural"),
    al.Table.at([0.1, 0.2, 0.5], KNOTS, KNOTS / 3.0, KNOTS / 7.0),
]
FULL = np.array([[30.0, 1.0], [1.0, 20.0]])
LAWS = [
    al.Adaptive(ARM, MOTIONS[3], 40.0, [20.0, 10.0], np.diag([5.0, 4.0, 3.0]), estimate=[0.1, 0.2, 1.0 / 3.0]),
    al.Adaptive(ARM, MOTIONS[0], FULL, FULL, 5.0),
    al.ComputedTorque(ARM, MOTIONS[1], FULL, 20.0),
    al.Adaptive(ARM, MOTIONS[1], FULL, 20.0, 2.0, friction=["stribeck"], armature=True, leakage=0.1, leakage_form="e", dead_zone=0.2),
    al.Adaptive(ARM, MOTIONS[1], FULL, 20.0, 2.0, composite=FULL, composite_rate=3.0),
    al.Adaptive(ARM, MOTIONS[1], FULL, 20.0, 2.0, friction=True, friction_speed=[0.1, 0.2], leakage=0.1, leakage_centre=[0.5] * 7),
]
WAYS: dict[str, Callable[[Any], Any]] = {
    **{f"pickle {p}": lambda x, p=p: pickle.loads(pickle.dumps(x, p)) for p in range(2, pickle.HIGHEST_PROTOCOL + 1)},
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
}
way = pytest.mark.parametrize("back", WAYS.values(), ids=WAYS.keys())


@way
def test_arms(back: Callable[[Any], Any]) -> None:
    # The last arm is not physically possible. It exists, because `with_parameters` accepts any finite numbers.
    for arm in (ARM, al.planar_pr(1.0 / 3.0, 0.0, 1e-300), ARM.with_parameters([-1.0, 0.0, 2.0])):
        other = back(arm)
        assert type(other) is al.Arm and other == arm and hash(other) == hash(arm) and repr(other) == repr(arm)
        np.testing.assert_array_equal(other.parameters, arm.parameters)
    assert back(ARM) != ARM.with_parameters([2.0, 0.5, 0.26])


@way
@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: type(motion).__name__)
def test_motions(back: Callable[[Any], Any], motion: Any) -> None:
    other = back(motion)
    assert type(other) is type(motion) and other == motion and repr(other) == repr(motion) and other.n == 2
    for t in (0.0, 0.1, 0.7, 5.0):
        for x, y in zip(other(t), motion(t), strict=True):
            np.testing.assert_array_equal(x, y)


@way
@pytest.mark.parametrize("law", LAWS, ids=["adaptive", "adaptive from zero", "computed torque", "held back", "composite", "with friction"])
def test_laws_and_plants(back: Callable[[Any], Any], law: Any) -> None:
    plant, other = back(al.RigidArm(ARM)), back(law)
    assert type(plant) is al.RigidArm and plant.arm == ARM and repr(plant) == repr(al.RigidArm(ARM))
    assert type(other) is type(law) and other.arm == law.arm and other.motion == law.motion and repr(other) == repr(law)
    for name, value in law.terms(0.3, [0.1, 0.2], [0.3, 0.4]).items():
        np.testing.assert_array_equal(other.terms(0.3, [0.1, 0.2], [0.3, 0.4])[name], value)
    ours, theirs = (al.simulate(al.RigidArm(ARM), each, [0.1, 0.2], t_end=0.02, dt=1e-3) for each in (law, other))
    np.testing.assert_array_equal(ours.q, theirs.q)


@way
def test_directions_keep_their_bits(back: Callable[[Any], Any]) -> None:
    """The normal of a wall and the axes of joints are unit vectors up to rounding, and a copy does not divide by their length again."""
    rng = np.random.default_rng(7)
    for _ in range(30):
        wall = al.Wall("link1", [0.7, 0.1, 0.0], rng.standard_normal(3), stiffness=1e3, damping=5.0)
        assert repr(back(wall)) == repr(wall)
        arm = al.Arm.from_chain([{"type": "R", "axis": list(rng.standard_normal(3)), "phi": [1, 0.1, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1]}])
        assert back(arm) == arm


def same(a: Any, b: Any) -> None:
    assert type(a) is type(b) and repr(a) == repr(b)
    for name in ("t", "q", "v", "tau", "estimate", "parameters", "status"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert a.monitors.keys() == b.monitors.keys() and a.units == b.units and a.law_name == b.law_name
    for name in a.monitors:
        np.testing.assert_array_equal(a.monitors[name], b.monitors[name])
    for x, y in zip(a.desired(), b.desired(), strict=True):
        np.testing.assert_array_equal(x, y)


@way
def test_runs(back: Callable[[Any], Any]) -> None:
    run = al.simulate(al.RigidArm(ARM), LAWS[0], [0.1, 0.2], t_end=0.05, dt=1e-3)
    batch = al.simulate_batch(al.RigidArm(ARM), LAWS[0], np.zeros((3, 2)), t_end=0.05, dt=1e-3, record_every=10)
    same(back(run), run)
    same(back(batch), batch)
    same(back(batch)[1], batch[1])


@way
def test_errors(back: Callable[[Any], Any]) -> None:
    wild = al.Adaptive(ARM, MOTIONS[0], 400.0, 200.0, 1e6)
    with pytest.raises(al.SolveError) as solve:
        al.simulate(al.RigidArm(ARM), wild, [0.0, 0.0], t_end=50.0, dt=0.05)
    other = back(solve.value)
    assert type(other) is al.SolveError and str(other) == str(solve.value)
    assert other.status is al.Status.DIVERGED and other.t == solve.value.t
    same(other.partial, solve.value.partial)
    with pytest.raises(al.InputError) as misuse:
        al.planar_pr(1.0, 2.0, 1.0)
    assert type(back(misuse.value)) is al.InputError and str(back(misuse.value)) == str(misuse.value)
    model = back(al.ModelError("load_urdf: link is bad", "arm.urdf", 12))
    assert type(model) is al.ModelError and (model.file, model.line, str(model)) == ("arm.urdf", 12, "load_urdf: link is bad")
    for kind in (al.ArmletError, al.FormatError, al.InternalError):
        assert type(back(kind("x"))) is kind and str(back(kind("x"))) == "x"
    for status in al.Status:
        assert back(status) is status


def test_reprs_are_calls_of_the_constructor() -> None:
    """The `repr` of an arm, motion or law is the call that constructs it. The `repr` of a run has its result."""
    names = {name: getattr(al, name) for name in al.__all__}
    assert eval(repr(ARM), names) == ARM
    for motion in MOTIONS:
        assert eval(repr(motion), names) == motion
    for law in LAWS:
        again = eval(repr(law), names)
        np.testing.assert_array_equal(again(0.3, [0.1, 0.2], [0.3, 0.4]), law(0.3, [0.1, 0.2], [0.3, 0.4]))
    assert repr(al.RigidArm(ARM)) == "RigidArm(planar_pr(A=2, B=0.5, C=0.25))"
    run = al.simulate(al.RigidArm(ARM), LAWS[0], [0.1, 0.2], t_end=0.05, dt=1e-3)
    assert "Adaptive" in repr(run) and "t=0..0.05 s" in repr(run) and "success" in repr(run)


def test_the_hot_classes_take_no_attributes() -> None:
    """Setting a misspelt attribute is an error and does not create an attribute."""
    for thing in (ARM, MOTIONS[0], LAWS[0], al.RigidArm(ARM)):
        with pytest.raises(AttributeError):
            thing.gravty = 1.0  # type: ignore[union-attr]


LOOPS: dict[str, dict[str, Any]] = {
    "in every stage": {},
    "euler": {"method": "euler"},
    "implicit": {"method": "ros2"},
    "sampled": {"sample_time": 4e-3},
    "saturated": {"tau_max": 5.0, "v0": [0.1, -0.2]},
}


@way
@pytest.mark.parametrize("options", LOOPS.values(), ids=LOOPS.keys())
@pytest.mark.parametrize("law", [LAWS[0], LAWS[2]], ids=["adaptive", "computed torque"])
def test_simulators_go_on_where_they_were(back: Callable[[Any], Any], options: dict[str, Any], law: Any) -> None:
    sim = al.Simulator(al.RigidArm(ARM), law, [0.1, 0.2], dt=1e-3, **options)
    for _ in range(8):
        sim.step()
    other = back(sim)
    assert type(other) is al.Simulator and repr(other) == repr(sim)
    assert repr(sim).startswith(f"Simulator({type(law).__name__}, n=2, t=0.008 s")
    for name, value in sim.state.items():
        np.testing.assert_array_equal(other.state[name], value)
    for _ in range(20):
        sim.step()
        other.step()
    assert other.t == sim.t
    np.testing.assert_array_equal(np.concatenate([other.q, other.v, other.tau]), np.concatenate([sim.q, sim.v, sim.tau]))
    sim.reset()
    other.reset()
    np.testing.assert_array_equal(other.q, sim.q)


def test_a_simulator_between_samples_refuses_to_be_pickled() -> None:
    sim = al.Simulator(al.RigidArm(ARM), LAWS[2], [0.1, 0.2], dt=1e-3, sample_time=al.Sampling(4e-3, delay=1e-3))
    assert pickle.loads(pickle.dumps(sim)).t == 0.0
    sim.step()
    with pytest.raises(TypeError, match=r"^Simulator: can't be pickled here"):
        pickle.dumps(sim)
    alone = al.Simulator(al.RigidArm(ARM), None, [0.1, 0.2], dt=1e-3)
    alone.step([1.0, 0.5])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(alone)).q, alone.q)
    assert repr(alone) == "Simulator(no law, n=2, t=0.001 s, dt=0.001 s)"


def test_a_pickle_of_many_links_is_as_few_objects_as_one_of_few() -> None:
    """Writing or reading a pickle holds the interpreter lock for each object. So the number of objects must not grow with the links."""
    counts = []
    for links in (5, 500):
        arm = al.planar_arm(np.ones(links))
        _, (payload,) = arm.__reduce__()
        counts.append(sum(1 for _ in pickletools.genops(payload[32:])))
        back = pickle.loads(pickle.dumps(arm))
        assert back == arm and repr(back) == repr(arm) and back.frame_names == arm.frame_names and back.report == arm.report
    # The larger pickle may have one more frame of the pickle protocol.
    assert counts[1] <= counts[0] + 1


def test_names_of_any_letters_survive_a_pickle() -> None:
    joint = {"type": "R", "axis": [0.0, 0.0, 1.0], "phi": [1.0, 0.5, 0.0, 0.0, 0.3, 0.0, 0.0, 0.3, 0.0, 0.3]}
    slide = joint | {"type": "P", "name": "b", "upper": 2.0}
    arm = al.Arm.from_chain([joint | {"name": "é \U0001f916"}, slide, {"type": "F", "name": "c"}])
    back = pickle.loads(pickle.dumps(arm))
    assert back == arm and back.joint_names == ("é \U0001f916", "b") and back.joint_types == arm.joint_types
    np.testing.assert_array_equal(back.limits["q_max"], arm.limits["q_max"])


# A pickle stores an array in pieces. These are more numbers than one piece contains, and not a multiple of a piece.
MANY = 600_001
SHARE = 1 << 22


def longest_bytes(pickled: bytes) -> int:
    return max((len(value) for _, value, _ in pickletools.genops(pickled) if isinstance(value, bytes)), default=0)


def test_large_arrays_are_pickled_in_shares() -> None:
    """Python writes and reads bytes without interruption, so no other thread runs meanwhile and no signal is handled.

    So pieces must be small.
    """
    q = np.random.default_rng(3).standard_normal((MANY, 1))
    table = al.Table(1e-3, q, 2.0 * q, 3.0 * q)
    assert longest_bytes(pickle.dumps(table)) <= SHARE
    _, (digest, *shares) = table.__reduce__()
    body = b"".join(copy.deepcopy(share) for share in shares)
    assert len(digest) == 32 and longest_bytes(body) <= SHARE
    for back in (pickle.loads(pickle.dumps(table)), copy.copy(table), copy.deepcopy(table)):
        for ours, theirs in zip(back(0.5 * MANY * 1e-3), table(0.5 * MANY * 1e-3), strict=True):
            np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("shape", [(MANY,), (2, MANY), (MANY, 2, 1)])
def test_a_stored_array_is_restored(shape: tuple[int, ...]) -> None:
    x = np.random.default_rng(4).standard_normal(shape)
    x.flat[0], x.flat[-1] = -0.0, np.nan
    make, (stored_shape, *shares) = al._core._stored_array(x)
    back = make(stored_shape, *(copy.deepcopy(share) for share in shares))
    assert back.shape == shape and back.dtype == np.float64 and back.flags.writeable
    np.testing.assert_array_equal(back.view(np.int64), x.view(np.int64))


@pytest.mark.parametrize("x", [np.zeros(3), np.zeros((MANY, 2))[:, :1], np.asfortranarray(np.zeros((MANY, 2))), np.zeros(MANY, np.float32)])
def test_other_arrays_are_stored_as_numpy_does(x: np.ndarray) -> None:
    make, *_ = al._core._stored_array(x)
    assert make is not al._core._restore_array


@pytest.mark.parametrize("stored", [((2,), b"12345678"), ((1,), b"1234567"), ((2**40, 2**40), b""), ((1,), 3.0), ((-1,), b"")])
def test_a_damaged_array_is_refused(stored: tuple[Any, ...]) -> None:
    with pytest.raises(al.FormatError, match="the stored array is damaged"):
        al._core._restore_array(*stored)
