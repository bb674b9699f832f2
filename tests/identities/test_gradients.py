"""Derivatives of runs of rigid arms, elastic arms and `VelocityArm`: compared with differences of runs, the adjoint, and closed forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al
from armlet.reference import sensitivity
from armlet.run.named_numbers import loop_with, named_numbers

Array = NDArray[np.float64]

ARM = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], inertias=[0.3, 0.2])
THREE = al.planar_arm([0.5, 0.4, 0.3], masses=[3.0, 2.0, 1.0], inertias=[0.3, 0.2, 0.2])
Q0, V0 = np.array([0.1, -0.2]), np.array([0.3, 0.2])
SWING = al.Sinusoid([0.1, 0.0], [0.4, 0.3], [1.0, 2.0], [0.1, 0.3])
GAINS: dict[str, Any] = {"kp": [8.0, 6.0], "kd": [3.0, 2.0]}
FULL = {"kp": [[8.0, 1.0], [1.0, 6.0]], "kd": [[3.0, 0.5], [0.5, 2.0]]}
K, B = [300.0, 200.0], [0.2, 0.1]
TIP = {"frame": "link2", "axes": "xy"}


def elastic(law: Any, **more: Any) -> Any:
    """An elastic law with exact joint stiffness. `more` are further arguments."""
    return law(ARM, [0.4, 0.3], **({"kp": [8.0, 6.0], "kd": [1.0, 1.0], "joint_stiffness": K} | more))


LAWS: dict[str, Callable[[], Any]] = {
    "PDGravity": lambda: al.PDGravity(ARM, [0.4, 0.3], **GAINS),
    "full gains": lambda: al.PDGravity(ARM, [0.4, 0.3], **FULL),
    "PID": lambda: al.PID(ARM, [0.4, 0.3], kp=[8.0, 6.0], ki=[2.0, 3.0], kd=[3.0, 2.0]),
    "PID, all options": lambda: al.PID(
        ARM,
        SWING,
        kp=[8.0, 6.0],
        ki=[2.0, 3.0],
        kd=[3.0, 2.0],
        # The torque of the first joint exceeds its limit in the whole run, the other never does. So no limit begins or ends to act.
        tau_max=[9.0, 7.0],
        derivative_filter=[90.0, 120.0],
        friction=True,
        observer_bandwidth=[30.0, 20.0],
        nominal_inertia=[0.5, 0.2],
    ),
    "ComputedTorque": lambda: al.ComputedTorque(ARM, SWING, **GAINS),
    "Adaptive": lambda: al.Adaptive(ARM, SWING, **GAINS, gamma=0.3, estimate=0.8 * ARM.parameters),
    "Adaptive, full gains": lambda: al.Adaptive(ARM, SWING, **FULL, gamma=0.3, estimate=0.8 * ARM.parameters),
    "Adaptive, composite": lambda: al.Adaptive(ARM, SWING, **GAINS, gamma=0.1, composite=0.3, composite_rate=8.0),
    "Adaptive, leakage": lambda: al.Adaptive(ARM, SWING, **GAINS, gamma=0.1, leakage=0.2, friction=True, armature=True),
    "CartesianImpedance": lambda: al.CartesianImpedance(ARM, [0.7, 0.1], [40.0, 30.0], [6.0, 5.0], **TIP),
    "CartesianImpedance, moving": lambda: al.CartesianImpedance(
        ARM, al.Sinusoid([0.7, 0.1], [0.1, 0.1], [2.0, 1.0], [0.0, 0.5]), [40.0, 30.0], [6.0, 5.0], **TIP
    ),
    "MotorPD": lambda: elastic(al.MotorPD),
    "MotorPD, moving": lambda: al.MotorPD(ARM, SWING, **GAINS, joint_stiffness=K, online=True),
    "StateFeedback, moving": lambda: al.StateFeedback(ARM, SWING, **GAINS, kt=0.5, ks=0.01, joint_stiffness=K),
    "JointImpedance, moving": lambda: al.JointImpedance(ARM, SWING, [8.0, 6.0], [3.0, 2.0], K, B, [0.1, 0.06]),
    "JointTracking": lambda: al.JointTracking(ARM, SWING, **GAINS, joint_stiffness=K, motor_inertia=B),
    "JointImpedance": lambda: al.JointImpedance(
        ARM, [0.4, 0.3], [8.0, 6.0], [3.0, 2.0], joint_stiffness=K, motor_inertia=B, reduced_inertia=[0.1, 0.06]
    ),
    "ElasticImpedance": lambda: al.ElasticImpedance(ARM, [0.7, 0.1], [40.0, 30.0], [6.0, 5.0], K, B, [0.1, 0.06], **TIP),
    "PriorityVelocity": lambda: al.PriorityVelocity(
        ARM, [al.Task("link2", "x", target=[0.6], gain=2.0), al.Task("link1", "y", target=[0.1], gain=1.5)]
    ),
    "PriorityAcceleration": lambda: al.PriorityAcceleration(ARM, [al.Task("link2", "xy", target=[0.6, 0.2], gain=8.0)]),
}
ELASTIC = ("MotorPD", "StateFeedback", "JointTracking", "JointImpedance", "ElasticImpedance")


def plant_of(name: str) -> Any:
    if name.partition(",")[0] in ELASTIC:
        return al.ElasticArm(ARM, K, B)
    return al.VelocityArm(ARM) if name == "PriorityVelocity" else al.RigidArm(ARM)


def start_of(options: dict[str, Any]) -> dict[str, Any]:
    return {"q0": Q0, "v0": options.get("v0"), "theta0": None, "theta_dot0": None}


def records(plant: Any, law: Any, start: dict[str, Any], options: dict[str, Any], name: str, value: Array) -> Array:
    """The series of a run in which the parameter `name` has the value `value`. Gain matrices are kept symmetric."""
    if name.endswith((".kp", ".kd")) and value.ndim == 2:
        value = (value + value.T) / 2
    plant, law, begun = loop_with(plant, law, start, name, value)
    given = options | {part: begun[part] for part in ("v0", "theta0", "theta_dot0") if begun[part] is not None}
    run = al.simulate(plant, law, begun["q0"], monitors=False, **given)
    return np.concatenate([x for x in (run.q, run.v, run.tau, run.estimate, run.theta, run.theta_dot) if x is not None], axis=-1)


def derivatives(one: al.Sensitivity) -> Array:
    series = (one.q, one.v, one.tau, one.estimate, one.theta, one.theta_dot)
    return np.concatenate([x for x in series if x is not None], axis=1)


def compare(plant: Any, law: Any, names: list[str], options: dict[str, Any], tolerance: float) -> None:
    run = al.simulate(plant, law, Q0, monitors=False, sensitivity=names, **options)
    assert run.sensitivity is not None and list(run.sensitivity) == names
    known, moves = named_numbers(plant, law, start_of(options)), 0
    times = {"t_eval": run.t} if options.get("method", "rk4").startswith("dop") else {}
    for name in names:
        value = known[name]
        size = np.where(value == 0.0, 0.05, np.abs(value))
        expected = sensitivity(lambda at, name=name: records(plant, law, start_of(options), options | times, name, at), value, size)
        got = derivatives(run.sensitivity[name])
        largest, values = np.abs(expected).max(), records(plant, law, start_of(options), options | times, name, value)
        moves += largest > 1e-6
        # Rounding errors of the runs of the difference quotient, divided by its step, which is 1e-3 of `size`.
        rounding = 4e-15 * np.abs(values).max() / (1e-3 * size.min())
        np.testing.assert_allclose(got, expected, rtol=0.0, atol=tolerance * largest + rounding, err_msg=name)
    assert moves >= len(names) - 1, "nearly every number moves the run"


def wanted(name: str, plant: Any, law: Any, options: dict[str, Any]) -> list[str]:
    """Parameters of a loop, without those of its arms, thresholds, damping ratios and initial motor states."""
    known = named_numbers(plant, law, start_of(options))
    drives = ("arm.damping", "arm.friction", "arm.armature")
    left = ("arm.parameters", *drives, ".eps", "friction_speed", "rounding", "damping_ratio", "theta0", "theta_dot0")
    names = [each for each in known if not each.endswith(left)]
    return [each for each in names if not (name == "PriorityVelocity" and each == "v0")]


@pytest.mark.parametrize("sample_time", [None, 4e-3], ids=["continuous", "sampled"])
@pytest.mark.parametrize("name", LAWS)
def test_every_law_by_fixed_steps(name: str, sample_time: float | None) -> None:
    law, plant = LAWS[name](), plant_of(name)
    options: dict[str, Any] = {"t_end": 0.04, "dt": 2e-3, "sample_time": sample_time, "record_every": 4}
    if name != "PriorityVelocity":
        options["v0"] = V0
    compare(plant, law, wanted(name, plant, law, options), options, 1e-9)


@pytest.mark.parametrize("method", ["euler", "semi_implicit", "rk4"])
@pytest.mark.parametrize("name", ["Adaptive", "MotorPD"])
def test_every_method_with_fixed_steps(name: str, method: str) -> None:
    options: dict[str, Any] = {"t_end": 0.0405, "dt": 2e-3, "method": method, "v0": V0, "t_eval": [0.0, 0.0101, 0.02, 0.0405]}
    compare(plant_of(name), LAWS[name](), ["law.kp", "q0", "v0", "arm.parameters", "law.arm.parameters"], options, 1e-8)


@pytest.mark.parametrize("method", ["dopri5", "dop853"])
def test_adaptive_methods_with_their_steps_frozen(method: str) -> None:
    options: dict[str, Any] = {"t_end": 0.1, "method": method, "rtol": 1e-12, "atol": 1e-13, "v0": V0, "t_eval": [0.0, 0.033, 0.1]}
    # Runs with changed parameters take different steps. So the difference quotient divides the errors of the runs by its step, which
    # is 1e-3 of `size`.
    compare(plant_of("Adaptive"), LAWS["Adaptive"](), ["law.kp", "law.gamma", "law.motion.amplitude", "q0", "v0"], options, 1e-7)


CLOCKS = {
    "late": al.Sampling(4e-3, delay=6e-3, sensor_delay=2),
    "limited rate": al.Sampling(4e-3, rate_limit=300.0),
    "jitter": al.Sampling(4e-3, jitter=2e-3, seed=3),
    "noise": al.Sampling(4e-3, noise={"v": 0.01}, seed=4),
}


@pytest.mark.parametrize("clock", CLOCKS)
def test_clocks(clock: str) -> None:
    options: dict[str, Any] = {"t_end": 0.06, "dt": 2e-3, "v0": V0, "sample_time": CLOCKS[clock]}
    compare(plant_of(""), LAWS["ComputedTorque"](), ["law.kp", "law.kd", "q0", "law.motion.amplitude"], options, 1e-9)


@pytest.mark.parametrize("clock", ["late", "limited rate"])
@pytest.mark.parametrize("name", ["Adaptive", "Guarded"])
def test_clocks_of_laws_with_states(name: str, clock: str) -> None:
    """The state of a law changes at the sample. The state of an observer integrates the torque that acts."""
    law = al.Guarded(LAWS["PDGravity"](), al.MomentumObserver(ARM, 30.0)) if name == "Guarded" else LAWS[name]()
    names = ["law.law.kp", "law.law.kd"] if name == "Guarded" else ["law.kp", "law.gamma"]
    options: dict[str, Any] = {"t_end": 0.06, "dt": 2e-3, "v0": V0, "sample_time": CLOCKS[clock]}
    compare(plant_of(""), law, [*names, "q0", "v0"], options, 1e-8)


def test_quantisation_counts_as_the_identity() -> None:
    options: dict[str, Any] = {"t_end": 0.02, "dt": 2e-3, "v0": V0}
    fine, coarse = (al.Sampling(4e-3, resolution={"q": step}) for step in (0.0, 1e-7))
    law = LAWS["PDGravity"]()
    runs = [al.simulate(plant_of(""), law, Q0, sensitivity="law.kp", sample_time=clock, **options) for clock in (fine, coarse)]
    first, second = (derivatives(run.sensitivity["law.kp"]) for run in runs if run.sensitivity is not None)
    # The runs differ by the resolution of the measurements.
    np.testing.assert_allclose(second, first, rtol=0.0, atol=1e-5 * np.abs(first).max())
    assert np.abs(first).max() > 1e-3


@pytest.mark.parametrize(
    "more",
    [
        {"tau_max": [40.0, 3.0]},
        {"force": [(0.0, [1.0, 2.0, 0.0]), (0.0155, [5.0, 0.0, 0.0])], "force_frame": "link2"},
        {"force": lambda t: [10.0 * t, 1.0, 0.0], "force_frame": "link2"},
    ],
    ids=["saturation", "force in steps", "force in Python"],
)
def test_saturation_and_forces(more: dict[str, Any]) -> None:
    options: dict[str, Any] = {"t_end": 0.04, "dt": 2e-3, "v0": V0, **more}
    compare(plant_of(""), LAWS["PDGravity"](), ["law.kp", "law.kd", "law.target", "q0"], options, 1e-9)


def test_a_wall_and_stops_on_the_branch_taken() -> None:
    wall = al.Wall("link2", [0.86, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=300.0, damping=5.0)
    plant = al.RigidArm(ARM, wall=wall)
    options: dict[str, Any] = {"t_end": 0.04, "dt": 2e-3, "v0": V0}
    compare(plant, LAWS["PDGravity"](), ["plant.wall.stiffness", "plant.wall.damping", "law.kp"], options, 1e-8)


def test_the_inertial_parameters_of_plant_and_law_apart() -> None:
    options: dict[str, Any] = {"t_end": 0.04, "dt": 2e-3, "v0": V0}
    for name in ("ComputedTorque", "MotorPD"):
        compare(plant_of(name), LAWS[name](), ["arm.parameters", "law.arm.parameters"], options, 1e-8)


def test_an_exponential_has_its_closed_form() -> None:
    """One joint follows `v = g (q_d - q)` exactly, and RK4 multiplies the error by `r` in each step: `e_k = r^k e_0`."""
    arm, g, h, steps = al.planar_arm([1.0]), 1.5, 0.01, 50
    law = al.PriorityVelocity(arm, [al.PostureTask([0.8], gain=g)])
    run = al.simulate(al.VelocityArm(arm), law, [0.2], t_end=h * steps, dt=h, sensitivity=["q0", "law.tasks.0.gain", "law.tasks.0.target"])
    z, k = -g * h, np.arange(steps + 1)
    r, slope = 1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24, 1 + z + z**2 / 2 + z**3 / 6
    assert run.sensitivity is not None
    found = {name: one.q[:, 0, 0] for name, one in run.sensitivity.items()}
    # The results agree up to rounding.
    np.testing.assert_allclose(found["q0"], r**k, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found["law.tasks.0.target"], 1 - r**k, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found["law.tasks.0.gain"], 0.6 * k * r ** (k - 1.0) * slope * h, rtol=0.0, atol=1e-12)


ADJOINTS: dict[str, tuple[str, dict[str, Any]]] = {
    "continuous": ("Adaptive", {"dt": 2e-3}),
    "semi-implicit": ("MotorPD", {"dt": 2e-3, "method": "semi_implicit"}),
    "late": ("ComputedTorque", {"dt": 2e-3, "sample_time": CLOCKS["late"]}),
    "limited rate": ("ComputedTorque", {"dt": 2e-3, "sample_time": CLOCKS["limited rate"], "t_eval": [0.0, 0.0101, 0.0395]}),
    "saturation": ("PID", {"dt": 2e-3, "tau_max": [2.0, 1.5]}),
    "adaptive steps": ("Adaptive", {"method": "dop853", "t_eval": [0.0, 0.013, 0.04]}),
    "tasks": ("PriorityVelocity", {"dt": 2e-3}),
}


@pytest.mark.parametrize("case", ADJOINTS)
def test_the_adjoint_is_the_transpose_of_the_tangents(case: str) -> None:
    name, more = ADJOINTS[case]
    law, plant, options = LAWS[name](), plant_of(name), {"t_end": 0.04, **more}
    names = wanted(name, plant, law, options)
    run = al.simulate(plant, law, Q0, monitors=False, sensitivity=names, **options)
    rng = np.random.default_rng(5)
    series = [each for each in ("q", "v", "tau", "estimate", "theta", "theta_dot") if getattr(run, each) is not None]
    slopes = {each: rng.standard_normal(getattr(run, each).shape) for each in series}
    assert run.sensitivity is not None
    # With little memory, states between two checkpoints are computed again.
    for memory in (1 << 26, 1 << 10):
        _, found = al.gradient(lambda _: (0.0, slopes), plant, law, Q0, names, memory=memory, **options)
        for one in run.sensitivity.values():
            parts = [np.einsum("ki,kij->j", slopes[each], getattr(one, each)) for each in series]
            expected, size = sum(parts), sum(np.abs(part) for part in parts)
            assert found[one.name].shape == one.shape
            np.testing.assert_allclose(found[one.name].ravel(), expected, rtol=0.0, atol=1e-11 * max(np.max(size), 1e-12))


def test_losses_by_name_by_function_and_of_a_scenario() -> None:
    law, plant = LAWS["PDGravity"](), plant_of("")
    options: dict[str, Any] = {"t_end": 0.5, "dt": 2e-3}
    names = ["law.kp", "law.kd"]
    target, weights = np.array([0.4, 0.3]), np.full(251, 1.0 / 250)
    weights[[0, -1]] /= 2

    def number(run: Any) -> Any:
        return (weights[:, None] * ((run.q - target) ** 2 + 1e-3 * run.tau**2)).sum() + 2.0 * ((run.q[-1] - target) ** 2).sum()

    by_name = al.gradient({"error_rms": 1.0, "tau_rms": 1e-3, "error_final": 2.0}, plant, law, Q0, names, **options)
    by_function = al.gradient(number, plant, law, Q0, names, **options)
    metrics = al.simulate(plant, law, Q0, **options).metrics()
    assert by_name[0] == pytest.approx(by_function[0], rel=1e-12)
    expected = (metrics["error_rms"] ** 2 + 1e-3 * metrics["tau_rms"] ** 2 + 2.0 * metrics["error_final"] ** 2).sum()
    assert by_name[0] == pytest.approx(expected, rel=1e-12)
    for name in names:
        np.testing.assert_allclose(by_name[1][name], by_function[1][name], rtol=1e-10)
    scenario = al.Scenario.from_dict(
        {
            "arm": {"kind": "planar_arm", "lengths": [0.5, 0.4], "masses": [3.0, 2.0], "inertias": [0.3, 0.2]},
            "law": {"kind": "PDGravity", "target": [0.4, 0.3], **GAINS},
            "run": {"q0": Q0.tolist(), **options},
        }
    )
    found = al.gradient({"error_rms": 1.0, "tau_rms": 1e-3, "error_final": 2.0}, scenario, names=names)
    assert found[0] == by_name[0]
    np.testing.assert_array_equal(found[1]["law.kp"], by_name[1]["law.kp"])


def test_nothing_changes_without_names() -> None:
    for options in ({"dt": 2e-3}, {"method": "dopri5"}):
        runs = [al.simulate(plant_of(""), LAWS["Adaptive"](), Q0, t_end=0.1, sensitivity=names, **options) for names in (None, ["law.kp"])]
        assert runs[0].sensitivity is None and runs[1].sensitivity is not None
        np.testing.assert_array_equal(runs[0].q, runs[1].q)
        np.testing.assert_array_equal(runs[0].monitors["energy"], runs[1].monitors["energy"])


def test_a_loop_of_three_joints_in_every_group_of_directions() -> None:
    """There are more directions of differentiation than SIMD lanes, and the last group of lanes is not full."""
    law = al.Adaptive(THREE, al.Quintic(np.zeros(3), [0.4, 0.3, 0.2], 0.2), [8.0, 6.0, 5.0], [3.0, 2.0, 2.0], 0.3)
    names = ["law.estimate", "law.kp"]
    run = al.simulate(al.RigidArm(THREE), law, np.zeros(3), t_end=0.02, dt=2e-3, sensitivity=names)
    alone = al.simulate(al.RigidArm(THREE), law, np.zeros(3), t_end=0.02, dt=2e-3, sensitivity="law.kp")
    assert run.sensitivity is not None and alone.sensitivity is not None
    assert run.sensitivity["law.estimate"].q.shape == (11, 3, 30)
    np.testing.assert_array_equal(run.sensitivity["law.kp"].v, alone.sensitivity["law.kp"].v)


def test_rows_of_several_structures_have_the_bits_of_single_runs() -> None:
    """Rows with one structure share recorded functions.

    A gain of one and the leakage of an estimate change the structure, because recording folds constants 0 and 1.
    """
    rng = np.random.default_rng(8)

    def law(row: int) -> al.Adaptive:
        kp, kd = rng.uniform(4.0, 9.0, 2), rng.uniform(2.0, 3.0, 2)
        kp[0] = 1.0 if row % 2 else kp[0]
        return al.Adaptive(ARM, SWING, kp, kd, 0.3, estimate=rng.uniform(0.1, 0.5, 20), leakage=0.1 * (row // 2 % 2))

    # Rows 0 to 7 have four structures and separate laws. The last rows repeat two of these laws.
    laws = [law(row) for row in range(8)]
    laws += [laws[1], laws[2], laws[1]]
    plants = [al.RigidArm(ARM, friction=row % 3 == 0) for row in range(len(laws))]
    starts, names = rng.uniform(-0.3, 0.3, (len(laws), 2)), ["law.kd", "arm.damping", "q0"]
    options: dict[str, Any] = {"t_end": 0.05, "dt": 5e-3, "check_limits": False}
    expected = [al.gradient("error_rms", *loop, names, **options)[1] for loop in zip(plants, laws, starts, strict=True)]
    for threads in (1, 3):
        _, slopes = al.gradient("error_rms", plants, laws, starts, names, threads=threads, **options)
        for name in names:
            assert np.abs(slopes[name]).max() > 0.0
            np.testing.assert_array_equal(slopes[name], [row[name] for row in expected], err_msg=name)
