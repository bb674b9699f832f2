"""Refused arguments of `simulate(sensitivity=)` and `gradient`, and their messages."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.TWO_LINKS
PLANT, LAW = al.RigidArm(ARM), al.PDGravity(ARM, [0.4, 0.9], kp=[8.0, 6.0], kd=[1.6, 1.2])
OPTIONS: dict[str, Any] = {"t_end": 0.02, "dt": 1e-3}
Q0 = [0.1, -0.2]


def run(names: Any = "law.kp", law: Any = LAW, plant: Any = PLANT, **more: Any) -> al.Run:
    return al.simulate(plant, law, Q0, sensitivity=names, **(OPTIONS | more))


def gradient(loss: Any = "error_rms", names: Any = "law.kp", law: Any = LAW, **more: Any) -> Any:
    return al.gradient(loss, PLANT, law, Q0, names, **(OPTIONS | more))


ROWS = np.array([Q0, [0.2, 0.3], [0.0, 0.1]])


def batch(q0: Any = ROWS, names: Any = "law.kp", law: Any = LAW, **more: Any) -> al.BatchRun:
    return al.simulate_batch(PLANT, law, q0, sensitivity=names, **(OPTIONS | more))


TIP = al.Task("link2", "xy", target=[0.3, 0.4], gain=2.0)
ELASTIC = al.ElasticArm(ARM, [100.0, 80.0], 0.1)
MOTORS = al.MotorPD(ARM, [0.4, 0.9], 8.0, 1.0, joint_stiffness=[100.0, 80.0])
REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "unknown name": (lambda: run(["law.kp", "law.kpp"]), r"expected names of \[.*'law.kp'.*\], got 'law.kpp' \(first bad index 1\)"),
    "twice": (lambda: run(["law.kp", "law.kp"]), r"names law.kp twice.*first bad index 1"),
    "no names": (lambda: run([]), r"sensitivity is not a list of names"),
    "a number": (lambda: run(3), r"sensitivity is not a list of names"),
    "a list of numbers": (lambda: run([1.0]), r"sensitivity is not a list of names"),
    "implicit steps": (lambda: run(method="ros2"), r"method has no derivatives of runs: expected one of euler.*got ros2"),
    "implicit method": (lambda: run(method="radau5", dt=None), r"method has no derivatives of runs.*got radau5"),
    "law in Python": (lambda: run(law=lambda t, q, v: -q, sample_time=1e-3), r"law has no derivatives: expected a law of armlet"),
    "deciding law": (
        lambda: al.simulate(
            al.VelocityArm(ARM), al.PriorityVelocity(ARM, [TIP], method="sns", v_max=[1.0, 1.0]), [0.1, 0.8], sensitivity="q0", **OPTIONS
        ),
        r"law has no derivatives of runs: expected a law that is recorded",
    ),
    "stick-slip": (
        lambda: run(plant=al.RigidArm(ARM, friction=al.StickSlip(coulomb=0.5)), method="dopri5", dt=None),
        r"plant has no derivatives of runs: expected a plant without stick-slip friction",
    ),
    "torque sensor": (
        lambda: run(law=MOTORS, plant=ELASTIC, sample_time=al.Sampling(1e-3, torque_sensor=al.TorqueSensor())),
        r"sample_time has no derivatives of runs: expected a Sampling without torque_sensor",
    ),
    "an event that ends the run": (
        lambda: run(method="dopri5", dt=None, events=al.Event.joint(0, 0.2, stop=True)),
        r"events that end the run have no derivatives",
    ),
    "start of motors": (lambda: run("theta0"), r"unknown name"),
    "jump of a motion": (
        lambda: run("law.motion.duration", law=al.ComputedTorque(ARM, al.Quintic(Q0, [0.4, 0.9], 0.01), 10.0, 3.0)),
        r"law.motion.duration has no derivative: it moves an instant at which the motion jumps",
    ),
    "option that is off": (
        lambda: run("law.leakage", law=al.Adaptive(ARM, al.Hold(Q0), 8.0, 2.0, 0.1, leakage=0.0)),
        r"law.leakage has no derivative: it changes what the loop computes",
    ),
    "loss of no kind": (lambda: gradient(3.0), r"loss is of the wrong type"),
    "unknown loss": (lambda: gradient({"error_peak": 1.0}), r"loss has an unknown name: expected names of \['error_rms'"),
    "loss without a number": (lambda: gradient({"error_rms": "much"}), r"loss\['error_rms'\]"),
    "loss that is NaN": (lambda: gradient({"error_rms": np.nan}), r"loss\['error_rms'\]"),
    "loss of something else": (lambda: gradient(lambda _: "much"), r"gradient: loss "),
    "loss of an array": (lambda: gradient(lambda r: r.q), r"gradient: loss "),
    "slopes of the wrong shape": (lambda: gradient(lambda r: (0.0, {"q": r.q[:-1]})), r"slopes\['q'\]"),
    "slopes of something else": (lambda: gradient(lambda r: (0.0, {"estimate": r.q})), r"slopes of an unknown series.*got 'estimate'"),
    "slopes that are NaN": (lambda: gradient(lambda r: (0.0, {"q": np.nan * r.q})), r"slopes\['q'\] are not finite"),
    "three things": (lambda: gradient(lambda r: (0.0, {}, 1)), r"loss returned something else"),
    "not analytic": (lambda: gradient(lambda r: np.abs(r.q - [0.4, 0.9]).sum()), r"loss is not analytic"),
    "loss of floats": (
        lambda: gradient(lambda r: sum(float(x) ** 2 for x in r.q[:, 0])),
        r"makes real numbers of complex ones, as float\(\)",
    ),
    "loss of plain floats": (lambda: gradient(lambda r: float((r.q**2).sum().item())), r"makes real numbers of complex ones, as float\(\)"),
    "rows without records": (lambda: batch(keep="final"), r'sensitivity is not used: expected None with keep="final"'),
    "no start": (lambda: al.simulate(PLANT, LAW, None, sensitivity="law.kp", **OPTIONS), r"simulate: q0 is not an array of real numbers"),
    "no start of a gradient": (lambda: al.gradient("error_rms", PLANT, LAW, None, "law.kp", **OPTIONS), r"gradient: q0 is not an array"),
    "no rows": (lambda: batch(np.zeros((0, 2))), r"q0 has no rows: expected at least one with sensitivity"),
    "rows of laws and of starts": (lambda: batch(law=[LAW, LAW]), r"law has the wrong number of entries: expected 1 or 3, got 2"),
    "rows of gains of several shapes": (
        lambda: batch(law=[LAW, LAW, al.PDGravity(ARM, [0.4, 0.9], kp=5.0, kd=[1.6, 1.2])]),
        r"sensitivity names numbers of several shapes.*first bad index 2",
    ),
    "unknown name of rows": (lambda: batch(names="law.kpp"), r"simulate_batch: sensitivity has an unknown name"),
    "too many threads": (lambda: batch(threads=5000), r"threads is out of range"),
    "what a batch keeps": (lambda: al.gradient("error_rms", PLANT, LAW, ROWS, "law.kp", keep="final", **OPTIONS), r"keep is not used"),
    "reference that moves": (lambda: gradient("error_rms", "law.target"), r"no name that moves the reference, got law.target"),
    "no reference": (
        lambda: gradient("error_rms", "law.stiffness", al.CartesianImpedance(ARM, [0.6, 0.2], 40.0, 5.0, frame="link2", axes="xy")),
        r"loss names error_rms, which CartesianImpedance has not",
    ),
    "no memory": (lambda: gradient(memory=-1), r"memory is not a count"),
    "names twice": (lambda: gradient(sensitivity=["law.kp"]), r"sensitivity is not used"),
    "no gradient of nothing": (lambda: gradient(names=None), r"names is not a list of names"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_parameters_without_a_derivative_are_refused_by_name(case: str) -> None:
    call, message = REFUSED[case]
    with pytest.raises(al.InputError, match=message):
        call()


def test_a_run_that_diverges_has_no_derivative() -> None:
    with pytest.raises(al.SolveError, match="diverged"):
        run(law=al.PDGravity(ARM, Q0, 1e6, 1e6), t_end=1.0)
    failed = run(law=al.PDGravity(ARM, Q0, 1e6, 1e6), t_end=1.0, throw=False)
    assert failed.status == al.Status.DIVERGED
    assert failed.sensitivity is None


def test_near_a_singularity_a_priority_law_has_no_derivative() -> None:
    law = al.PriorityVelocity(ARM, [TIP])
    with pytest.raises(al.SolveError, match="near a singularity"):
        al.simulate(al.VelocityArm(ARM), law, [0.3, 1e-4], sensitivity="q0", **OPTIONS)


def test_a_run_keeps_its_derivatives_when_pickled() -> None:
    first = run(["law.kp", "q0"])
    again = pickle.loads(pickle.dumps(first))
    assert again.sensitivity is not None and first.sensitivity is not None
    np.testing.assert_array_equal(again.sensitivity["q0"].tau, first.sensitivity["q0"].tau)
    one = again.sensitivity["law.kp"]
    assert (one.name, one.shape, one.size, one.estimate) == ("law.kp", (2,), 2, None)
    assert repr(one) == "Sensitivity('law.kp', shape=(2,), 21 records)"


def test_a_grazing_contact_has_no_derivative() -> None:
    """A joint starts at rest at a stop and leaves it. The time of this contact has no derivative."""
    arm = al.planar_arm([1.0], gravity=[0.0, 0.0])
    plant = al.RigidArm(arm, stops=al.JointStops(1e3, 50.0, lower=-1.0, upper=1e-20))
    law = al.PDGravity(arm, [0.5], 10.0, 1.0)
    options: dict[str, Any] = {"t_end": 0.05, "method": "dop853", "v0": [1e-12], "check_limits": False}
    with pytest.raises(al.SolveError, match=r"a contact is grazed at t = .*no derivative") as caught:
        al.simulate(plant, law, [0.0], sensitivity="q0", **options)
    assert caught.value.status == al.Status.DEGRADED


def test_a_file_keeps_derivatives(tmp_path: Path) -> None:
    first = batch(names=["law.kp", "q0"])
    first.save(tmp_path / "batch.npz")
    again = al.load(tmp_path / "batch.npz")
    assert again.sensitivity is not None and first.sensitivity is not None and list(again.sensitivity) == ["law.kp", "q0"]
    assert again.sensitivity["law.kp"].shape == (2,)
    np.testing.assert_array_equal(again.sensitivity["q0"].tau, first.sensitivity["q0"].tau)


def test_a_scenario_has_names(tmp_path: Path) -> None:
    scenario = al.Scenario.from_dict(
        {
            "arm": {"kind": "planar_arm", "lengths": [0.5, 0.4]},
            "law": {"kind": "PDGravity", "target": [0.4, 0.9], "kp": [8.0, 6.0], "kd": [1.6, 1.2]},
            "run": {"q0": Q0, "sensitivity": ["law.kp", "arm.damping"], **OPTIONS},
        }
    )
    found, expected = scenario.run().sensitivity, run(["law.kp", "arm.damping"]).sensitivity
    assert found is not None and expected is not None and list(found) == list(expected)
    np.testing.assert_array_equal(found["law.kp"].q, expected["law.kp"].q)
    # A run inside a gradient or a sweep computes no derivatives of its scenario.
    assert al.gradient("error_rms", scenario, names="law.kp")[1]["law.kp"].shape == (2,)
    assert al.sweep(scenario, {"law.kp": [5.0, 9.0]})["completed"].tolist() == [1.0, 1.0]
    with pytest.raises(al.InputError, match=r"\$.run.sensitivity: expected a list of names, got 'law.kp'"):
        scenario.replace({"run.sensitivity": "law.kp"})
    with pytest.raises(al.InputError, match=r"\$.run.sensitivity\[0\]: has an unknown name"):
        scenario.replace({"run.sensitivity": ["law.kpp"]}).check()


def test_derivatives_are_drawn() -> None:
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure

    made = run("arm.parameters").sensitivity
    assert made is not None
    axes = made["arm.parameters"].plot(Figure())
    assert axes.shape == (3, 2)
    drawn = [line.get_ydata() for line in axes[2, 1].get_lines()]
    tau = made["arm.parameters"].tau[:, 1]
    assert len(drawn) == 8 and all(any(np.array_equal(line, tau[:, j]) for j in range(20)) for line in drawn)
    rows = batch().sensitivity
    assert rows is not None
    with pytest.raises(al.InputError, match="derivatives of a batch"):
        rows["law.kp"].plot(Figure())


def test_a_number_that_may_not_be_negative_is_varied_on_one_side() -> None:

    def touching(damping: float) -> al.RigidArm:
        return al.RigidArm(ARM, wall=al.Wall("link2", [0.8, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=100.0, damping=damping))

    found = run("plant.wall.damping", plant=touching(0.0), v0=[0.5, -1.0])
    moved = [al.simulate(touching(damping), LAW, Q0, v0=[0.5, -1.0], **OPTIONS).q for damping in (0.0, 1e-3, 2e-3)]
    assert found.sensitivity is not None
    # The reference is a one-sided difference of second order.
    expected = (4.0 * moved[1] - 3.0 * moved[0] - moved[2]) / 2e-3
    assert np.abs(expected).max() > 1e-6
    np.testing.assert_allclose(found.sensitivity["plant.wall.damping"].q[..., 0], expected, rtol=0.0, atol=1e-5 * np.abs(expected).max())


def test_numbers_that_are_zero_and_one_move() -> None:
    """The recorded code of a loop folds constants that are 0 or 1. Parameters with derivatives must remain inputs."""
    law = al.PDGravity(ARM, [0.0, 1.0], kp=[1.0, 6.0], kd=[1.0, 1.0])
    found = run(["law.kp", "law.kd", "law.target"], law=law).sensitivity
    assert found is not None
    for one in found.values():
        assert (np.abs(one.tau).max(axis=(0, 1)) > 1e-4).all(), one.name
