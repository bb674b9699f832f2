"""Metrics that are computed during the runs, compared with metrics of recorded runs."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

PR = models.PR
TWO = models.TWO_HEAVY_LINKS
THREE = al.planar_arm([0.4, 0.3, 0.2])


def chain(n: int) -> al.Arm:
    """A spatial chain of `n` joints with rotated axes and bodies of some kilograms."""
    rng = np.random.default_rng(3)
    body = np.zeros(10)
    for m, x, y, z in np.column_stack([rng.uniform(0.2, 0.4, 6), rng.uniform(-0.3, 0.3, (6, 3))]):
        body += m * np.array([1.0, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])
    shape = {"rpy": [0.0] * 3, "xyz": [0.3, 0.0, 0.1], "phi": body.tolist()}
    joints = [{"type": "R", "axis": rng.normal(size=3).tolist(), **shape} for _ in range(n)]
    return al.Arm.from_chain(joints, gravity=(0.0, 0.0, -9.81))


SIX = chain(6)
LIMITED = al.load_urdf(
    """<robot name="two"><link name="base"/>
    <link name="a">
    <inertial><mass value="2"/><origin xyz="0.2 0 0"/><inertia ixx="0.01" iyy="0.02" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <link name="b">
    <inertial><mass value="1"/><origin xyz="0 0 0.1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="turn" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
    <limit lower="-0.3" upper="0.35" velocity="1.5" effort="6"/></joint>
    <joint name="slide" type="prismatic"><parent link="a"/><child link="b"/><origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-0.1" upper="0.2" velocity="0.8" effort="11"/></joint></robot>"""
)
RIGID, ELASTIC, VELOCITY = al.RigidArm(TWO), al.ElasticArm(TWO, [900.0, 700.0], 0.4), al.VelocityArm(THREE)
QUINTIC = al.Quintic([0.0, 0.3], [0.6, 0.9], 0.06)
SWING = al.Sinusoid([0.3, 0.6], [0.2, 0.1], 9.0, 0.3)
AT: dict[str, Any] = {"dt": None, "t_eval": np.linspace(0.0, 0.1, 30)}
TIP: dict[str, Any] = {"frame": "link2", "axes": "xy"}


def tasks(target: Sequence[float] = (0.5, 0.4)) -> list[al.Task]:
    return [al.Task("link3", "xy", target, 8.0), al.PostureTask([0.2, 0.3, 0.4], 2.0)]


CASES: dict[str, Callable[[], tuple[Any, Any, dict[str, Any]]]] = {
    "adaptive PR": lambda: (al.RigidArm(PR), al.Adaptive(PR, al.Quintic([0.0, 0.0], [0.4, 0.8], 0.4), 60.0, 12.0, 2.0), {}),
    "adaptive, full gains": lambda: (RIGID, al.Adaptive(TWO, SWING, [[90.0, 5.0], [5.0, 60.0]], [12.0, 9.0], 0.2), {}),
    "adaptive, a base set": lambda: (RIGID, al.Adaptive(TWO, SWING, 90.0, 12.0, 0.2, base=TWO.base_parameters()), {}),
    "computed torque": lambda: (RIGID, al.ComputedTorque(TWO, QUINTIC, 400.0, 40.0), {}),
    "computed torque, a gain each": lambda: (RIGID, [al.ComputedTorque(TWO, SWING, 300.0 + 20.0 * i, 40.0) for i in range(5)], {}),
    "computed torque, a motion each": lambda: (RIGID, [al.ComputedTorque(TWO, al.Hold([0.1 * i, 0.5]), 300.0, 40.0) for i in range(5)], {}),
    "six axes": lambda: (al.RigidArm(SIX), al.ComputedTorque(SIX, al.Hold(np.linspace(0.2, 0.7, 6)), 300.0, 40.0), {"dt": 2e-3}),
    "six axes, adaptive in the natural metric": lambda: (
        al.RigidArm(SIX),
        al.Adaptive(SIX, al.Hold(np.linspace(0.2, 0.7, 6)), 60.0, 12.0, 0.1, estimate=SIX.parameters, natural=True),
        {"t_end": 0.03},
    ),
    "limits": lambda: (al.RigidArm(LIMITED), al.PDGravity(LIMITED, [0.3, 0.1], [60.0, 300.0], [2.0, 9.0]), {}),
    "limits of the input": lambda: (RIGID, al.PDGravity(TWO, [0.5, 0.9], [80.0, 60.0], [10.0, 5.0]), {"tau_max": [20.0, 10.0]}),
    "cartesian impedance": lambda: (RIGID, al.CartesianImpedance(TWO, [0.6, 0.4], 300.0, 30.0, **TIP), {}),
    "cartesian impedance, full gains": lambda: (
        RIGID,
        al.CartesianImpedance(TWO, [0.6, 0.4], [[300.0, 20.0], [20.0, 250.0]], [30.0, 20.0], **TIP),
        {"force": [(0.0, [3.0, 0.0]), (0.0305, [0.0, 2.0])]},
    ),
    "cartesian impedance, pushed at another frame": lambda: (
        al.RigidArm(SIX),
        al.CartesianImpedance(SIX, [0.5, 0.2, 0.1, 0.1, 0.3, 0.2], 200.0, 30.0, frame=SIX.frame_names[-1], axes="xyz rx ry rz"),
        {"force": [2.0, 0.0, 1.0, 0.1, 0.0, 0.0], "force_frame": SIX.frame_names[2], "t_end": 0.03},
    ),
    "elastic impedance": lambda: (ELASTIC, al.ElasticImpedance(TWO, [0.6, 0.4], 300.0, 30.0, [900.0, 700.0], 0.4, 0.1, **TIP), {}),
    "elastic tracking": lambda: (
        ELASTIC,
        al.ElasticTracking(TWO, al.Quintic([0.8, 0.2], [0.6, 0.4], 0.05), 300.0, 30.0, 700.0, 0.4, 0.1, **TIP),
        {},
    ),
    "joint impedance": lambda: (ELASTIC, al.JointImpedance(TWO, [0.3, 0.6], 200.0, 20.0, 700.0, 0.4, 0.1), {}),
    "joint tracking": lambda: (ELASTIC, al.JointTracking(TWO, SWING, 300.0, 40.0, 700.0, 0.4), {}),
    "motor PD": lambda: (ELASTIC, al.MotorPD(TWO, [0.3, 0.6], 300.0, 40.0, 700.0), {}),
    "state feedback": lambda: (ELASTIC, al.StateFeedback(TWO, [0.3, 0.6], 300.0, 40.0, 1.0, 0.1, 700.0), {}),
    "priority of velocities": lambda: (VELOCITY, al.PriorityVelocity(THREE, tasks()), {}),
    "priority of accelerations": lambda: (al.RigidArm(THREE), al.PriorityAcceleration(THREE, tasks()), {}),
    # The arm becomes stretched, which is a singularity. There the loop does not use its compiled code.
    "priority at a singularity": lambda: (VELOCITY, al.PriorityVelocity(THREE, tasks([1.5, 0.3])), {"t_end": 0.6, "dt": 5e-3}),
    "priority at a singularity, sampled": lambda: (
        VELOCITY,
        al.PriorityVelocity(THREE, tasks([1.5, 0.3])),
        {"t_end": 0.6, "dt": 5e-3, "sample_time": 15e-3},
    ),
    "priority of accelerations at a singularity": lambda: (
        al.RigidArm(THREE),
        al.PriorityAcceleration(THREE, tasks(), eps=0.2),
        {"t_end": 0.2, "dt": 2e-3},
    ),
    # The angles exceed the range of the sine in compiled loops, so the row is simulated again.
    "angles beyond a million": lambda: (
        RIGID,
        al.PDGravity(TWO, [0.5, 0.9], 1e-3, 1e-3),
        {"v0": np.outer([0.0, 3e8, 0.0, 0.0, 2e8], [1.0, 1.0]), "state_limit": np.inf, "t_end": 0.03, "monitors": False},
    ),
    "sampled": lambda: (RIGID, al.ComputedTorque(TWO, SWING, 300.0, 40.0), {"sample_time": 4e-3}),
    "sampled at each step": lambda: (RIGID, al.ComputedTorque(TWO, SWING, 300.0, 40.0), {"sample_time": 1e-3}),
    "a late sampled controller": lambda: (
        RIGID,
        al.ComputedTorque(TWO, SWING, 300.0, 40.0),
        {"sample_time": al.Sampling(2e-3, delay=1e-3, noise={"v": 0.01}, seed=2)},
    ),
    "a sampled adaptive law": lambda: (RIGID, al.Adaptive(TWO, SWING, 90.0, 12.0, 0.2), {"sample_time": 2e-3}),
    "a force that jumps": lambda: (
        RIGID,
        al.PDGravity(TWO, [0.3, 0.6], 60.0, 12.0),
        {"force": [(0.0, [3.0, 0.0, 0.0]), (0.0305, [0.0, 2.0, 0.0])], "force_frame": "link2"},
    ),
    "a wall": lambda: (
        al.RigidArm(TWO, wall=al.Wall("link2", [0.7, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=2e3, damping=10.0)),
        al.PDGravity(TWO, [0.2, 0.3], 200.0, 10.0),
        {},
    ),
    "no monitors": lambda: (RIGID, al.ComputedTorque(TWO, SWING, 300.0, 40.0), {"monitors": False}),
    "every third step": lambda: (RIGID, al.ComputedTorque(TWO, SWING, 300.0, 40.0), {"record_every": 3}),
    "times": lambda: (RIGID, al.ComputedTorque(TWO, SWING, 300.0, 40.0), {"t_eval": np.linspace(0.0, 0.0917, 40) ** 1.1}),
    "a last short step": lambda: (RIGID, al.ComputedTorque(TWO, SWING, 300.0, 40.0), {"t_end": 0.0996}),
    "one step": lambda: (RIGID, al.ComputedTorque(TWO, SWING, 300.0, 40.0), {"t_end": 1e-3}),
    "no step": lambda: (RIGID, al.ComputedTorque(TWO, SWING, 300.0, 40.0), {"t_end": 0.0}),
    "euler": lambda: (RIGID, al.ComputedTorque(TWO, SWING, 300.0, 40.0), {"method": "euler"}),
    "semi-implicit": lambda: (RIGID, al.ComputedTorque(TWO, SWING, 300.0, 40.0), {"method": "semi_implicit"}),
    "ros2": lambda: (RIGID, al.ComputedTorque(TWO, SWING, 300.0, 40.0), {"method": "ros2"}),
    "dopri5": lambda: (RIGID, al.ComputedTorque(TWO, SWING, 300.0, 40.0), {"method": "dopri5"} | AT),
    "radau5": lambda: (ELASTIC, al.MotorPD(TWO, [0.3, 0.6], 300.0, 40.0, 700.0), {"method": "radau5"} | AT),
}
MEASURES: tuple[dict[str, Any], ...] = ({}, {"settle": 0.3, "tolerance": 1e-13}, {"band": 0.1})


def start(plant: Any) -> np.ndarray[Any, Any]:
    n = plant.arm.n
    return np.random.default_rng(5).uniform(-0.1, 0.1, (5, n)) + np.linspace(0.1, 0.4, n)


def agree(plant: Any, law: Any, q0: Any, options: dict[str, Any], measures: dict[str, Any]) -> al.BatchRun:
    whole = al.simulate_batch(plant, law, q0, **options)
    assert whole.status[0] == al.Status.SUCCESS
    found = al.simulate_batch(plant, law, q0, keep="metrics", metrics=measures, **options)
    wanted, metrics = whole.metrics(**measures), found.metrics()
    assert list(metrics) == list(wanted)
    for name, values in wanted.items():
        # The sums over 100 records have another order, and monitors fuse multiplications and additions. So the values differ by rounding.
        # Differences of energies have the rounding error of the energies.
        rtol, atol = (0.0, 1e-12) if name == "energy_error" else (1e-10, 1e-12)
        if name == "monitor_violations" and "tolerance" in measures:
            continue  # violations at the level of rounding are random
        np.testing.assert_allclose(metrics[name], values, rtol, atol, err_msg=name)
    np.testing.assert_array_equal(found.status, whole.status)
    for name in ("q", "v", "tau", "theta", "theta_dot", "estimate"):
        last = getattr(whole, name)
        if last is not None:
            np.testing.assert_array_equal(getattr(found, name), last[:, -1:], err_msg=name)
    return found


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
@pytest.mark.filterwarnings("ignore")
def test_metrics_of_loops_are_those_of_records(case: Callable[[], tuple[Any, Any, dict[str, Any]]]) -> None:
    plant, law, options = case()
    for measures in MEASURES:
        agree(plant, law, start(plant), {"t_end": 0.1, "dt": 1e-3} | options, measures)


def test_accepted_steps_of_an_adaptive_method_need_no_times() -> None:
    law = al.ComputedTorque(TWO, SWING, 300.0, 40.0)
    batch = al.simulate_batch(RIGID, law, start(RIGID), t_end=0.1, method="dop853", keep="metrics")
    for i, q0 in enumerate(start(RIGID)):
        alone = al.simulate(RIGID, law, q0, t_end=0.1, method="dop853").metrics()
        for name, values in batch.metrics().items():
            np.testing.assert_allclose(values[i], alone[name], rtol=1e-10, atol=1e-12, err_msg=name)


def test_references_frames_and_rows_that_fail() -> None:
    q0 = start(RIGID)
    options: dict[str, Any] = {"t_end": 0.1, "dt": 1e-3}
    computed = al.ComputedTorque(TWO, SWING, 300.0, 40.0)
    for measures in ({"reference": [0.3, 0.5]}, {"frame": "link1"}, {"reference": [0.3, 0.5], "frame": "link2"}, {"band": [0.1, np.nan]}):
        agree(RIGID, computed, q0, options, measures)
    impedance = al.CartesianImpedance(TWO, [0.6, 0.4], 300.0, 30.0, **TIP)
    agree(RIGID, impedance, q0, options, {"reference": [0.3, 0.5]})
    # References for each record, (K, n) and (B, K, n). These metrics need the records.
    wanted = np.linspace([0.1, 0.4], [0.3, 0.6], 101)
    agree(RIGID, impedance, q0, options, {"reference": wanted})
    agree(RIGID, impedance, q0, options, {"reference": np.stack([wanted + 0.01 * i for i in range(5)])})
    # One row exceeds the state limit: its metrics are NaN, and other rows keep their bits.
    v0 = np.zeros((5, 2))
    v0[2] = 30.0
    found = agree(RIGID, computed, q0, options | {"v0": v0, "state_limit": 29.0}, {})
    assert found.status.tolist() == [0, 0, int(al.Status.DIVERGED), 0, 0] and np.isnan(found.metrics()["error_rms"][2]).all()
    assert found.metrics()["completed"].tolist() == [1.0, 1.0, 0.0, 1.0, 1.0]
    well = al.simulate_batch(RIGID, computed, q0, **options, keep="metrics")
    np.testing.assert_array_equal(well.metrics()["error_rms"][[0, 1, 3, 4]], found.metrics()["error_rms"][[0, 1, 3, 4]])


@pytest.mark.parametrize(
    "case", ["adaptive PR", "six axes", "priority of accelerations", "priority at a singularity", "elastic tracking", "sampled", "ros2"]
)
@pytest.mark.filterwarnings("ignore")
def test_bits_do_not_depend_on_other_rows(case: str) -> None:
    plant, law, options = CASES[case]()
    q0 = np.concatenate([start(plant), start(plant) + 0.05, start(plant) - 0.05])
    options = {"t_end": 0.1, "dt": 1e-3, "keep": "metrics"} | options
    whole = al.simulate_batch(plant, law, q0, threads=2, **options)
    for other, rows in (
        (al.simulate_batch(plant, law, q0, threads=1, **options), slice(None)),
        (al.simulate_batch(plant, law, q0[7:8], **options), slice(7, 8)),
        (al.simulate_batch(plant, law, q0[::-1].copy(), **options), slice(None, None, -1)),
    ):
        for name, values in whole.metrics().items():
            np.testing.assert_array_equal(other.metrics()[name], values[rows], err_msg=name)
        np.testing.assert_array_equal(other.q, whole.q[rows])


def test_invalid_arguments_of_metrics_are_refused() -> None:
    law = al.ComputedTorque(TWO, SWING, 300.0, 40.0)

    def batch(law: Any = law, **options: Any) -> al.BatchRun:
        return al.simulate_batch(RIGID, law, start(RIGID), **({"t_end": 0.01, "dt": 1e-3, "keep": "metrics"} | options))

    impedance = al.CartesianImpedance(TWO, [0.6, 0.4], 300.0, 30.0, **TIP)
    for options, message in (
        ({"metrics": {"bands": 0.1}}, "a name of metrics is unknown: expected one of reference, band, .*, got 'bands'"),
        ({"metrics": 3}, "metrics is of the wrong type: expected a table of arguments of armlet.metrics, got 3"),
        ({"metrics": {}, "keep": "final"}, 'metrics is not used: expected None with keep="final", got {}'),
        ({"metrics": {"band": [0.1, 0.2, 0.3]}}, r'metrics\["band"\] has the wrong shape'),
        ({"metrics": {"settle": "much"}}, r'metrics\["settle"\]'),
        ({"metrics": {"settle": np.inf}}, "settle is not finite"),
        ({"metrics": {"reference": [0.1, 0.2, 0.3]}}, r'metrics\["reference"\] has the wrong shape: expected \(2,\)'),
        ({"metrics": {"frame": "link9"}}, "link9"),
        ({"metrics": {"frame": 3}}, r'metrics\["frame"\]'),
        ({"metrics": {"frame": "link1"}, "law": impedance}, "frame is given for a run with no reference of joints"),
    ):
        with pytest.raises(al.InputError, match=f"^simulate_batch: .*{message}"):
            batch(**options)
    with pytest.raises(al.InputError, match="metrics: run kept its metrics alone"):
        batch().metrics(settle=0.1)
    assert batch(metrics={"settle": 0.1}).metrics()["settling_time"].shape == (5,)


def test_a_growing_band_gives_the_settling_time_of_the_whole_run() -> None:
    """A band relative to the largest error so far gives the settling time of the whole run.

    A band is a fraction of the largest error. If the fraction is below one, the record with the largest error is outside its band. From
    this record on, the band is constant.
    """
    rng = np.random.default_rng(7)
    settled = 0
    for case in range(400):
        records = 3 + case % 80
        t = np.cumsum(rng.uniform(0.01, 0.03, records))
        calm = np.exp(-rng.choice([0.0, 0.15]) * np.arange(records))[:, None]
        q = rng.normal(size=(records, 2)) * calm * [1.0, 0.3]
        settle = (0.02, 0.2, 0.6, 1.5)[case % 4]
        run = al.Run({"t": t, "q": q, "v": 0.0 * q, "target": np.zeros(2), "units": ("rad", "m"), "law_name": "PDGravity"})
        outside = (np.abs(q) > settle * np.maximum.accumulate(np.abs(q))).any(axis=1)
        after = records - np.argmax(outside[::-1]) if outside.any() else 0
        wanted = t[after] - t[0] if after < records else np.nan
        np.testing.assert_equal(float(run.metrics(settle=settle)["settling_time"]), wanted)
        settled += bool(np.isfinite(wanted))
    assert 50 < settled < 350


def test_settling_times_are_the_same_to_the_bit() -> None:
    """Errors grow at first, as in a fast motion. The bands are from 0.02 to 2 times the largest error."""
    law = al.ComputedTorque(TWO, al.Sinusoid([0.1, 0.4], [0.5, 0.4], 12.0, 0.0), 60.0, 9.0)
    q0 = np.tile([0.1, 0.4], (5, 1)) + 1e-3 * np.arange(5)[:, None]
    options: dict[str, Any] = {"t_end": 0.4, "dt": 2e-3}
    whole = al.simulate_batch(RIGID, law, q0, **options)
    times = []
    for settle in (0.02, 0.3, 0.7, 0.95, 1.0, 2.0):
        found = al.simulate_batch(RIGID, law, q0, keep="metrics", metrics={"settle": settle}, **options).metrics()["settling_time"]
        np.testing.assert_array_equal(found, whole.metrics(settle=settle)["settling_time"])
        times.append(found)
    assert len(np.unique(times)) >= 5 and np.all(times[-1] == 0.0)


def test_a_monitor_that_is_not_finite_ends_the_run() -> None:
    """The energy of row 2 overflows immediately, that of row 3 after some steps. Their states are still finite then."""
    options: dict[str, Any] = {"t_end": 0.1, "dt": 1e-3, "state_limit": np.inf, "v0": np.outer([0.0, 1e160, 1e153], [1.0, 0.0])}
    law = al.Adaptive(PR, al.Hold([0.3, 0.5]), 60.0, 12.0, 2.0)
    q0 = np.zeros((3, 2))
    whole = al.simulate_batch(al.RigidArm(PR), law, q0, **options)
    found = al.simulate_batch(al.RigidArm(PR), law, q0, keep="metrics", **options)
    assert whole.status.tolist() == found.status.tolist() == [0, int(al.Status.DIVERGED), int(al.Status.DIVERGED)]
    np.testing.assert_array_equal(found.stats["ended"], whole.stats["ended"])
    assert found.stats["ended"][1] == 0.0 < found.stats["ended"][2] < 0.1
    assert np.isnan(found.metrics()["error_rms"][1:]).all() and np.isfinite(found.metrics()["error_rms"][0]).all()


MEMORY = """
import resource, sys
import numpy as np
import armlet as al
arm = al.planar_pr(2.0, 0.5, 0.5)
law = al.ComputedTorque(arm, al.Hold([0.3, 0.5]), 60.0, 12.0)
def most(steps):
    al.simulate_batch(al.RigidArm(arm), law, np.zeros((16, 2)), t_end=steps * 1e-3, dt=1e-3, keep="metrics", threads=1)
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
few = most(500)
print(most(100_000) - few)
"""


def test_memory_does_not_depend_on_the_number_of_steps() -> None:
    """The records of 16 runs with 100,000 steps would need 140 MB, the times of the steps 2.4 MB."""
    printed = subprocess.run([sys.executable, "-c", MEMORY], capture_output=True, text=True, check=True).stdout
    assert int(printed) < 20_000  # kB; includes the table of the motion and the allocator
