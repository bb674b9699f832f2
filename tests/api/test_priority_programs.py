"""Priority laws as compiled programs. If a row has a singular step, the program declines it, and only this row takes the step directly."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

# The runs are only compared, so they need not be accurate.
pytestmark = pytest.mark.filterwarnings("ignore:.*balance does not close:UserWarning")

FOUR = al.planar_arm([1.0, 1.0, 0.25, 0.25])
TWO = models.TWO_HEAVY_LINKS
SEVEN = models.SEVEN_AXES
TOOL = SEVEN.tip_frame
BOTH = [al.Task("link4", "xy", [1.2, 1.0], 5.0), al.Task("link2", "xy", [0.9, 0.8], 5.0)]
POSE = [
    al.Task(TOOL, "xyz", [0.4, 0.2, 0.5], 4.0),
    al.Task(TOOL, "rx ry rz", [0.1, 3.0, 0.2], 4.0),
    al.PostureTask(target=np.zeros(7), gain=1.0),
]
ODD = [
    al.AxisTask(TOOL, [0, 0, 1], [0.1, 0.2, -1.0], 4.0),
    al.RelativeTask(TOOL, SEVEN.frame_names[3], "x ry", [0.3, 0.4], 3.0),
    al.CentreOfMassTask("xy", [0.1, 0.1], 2.0),
    al.JointLimitTask(gain=1.0),
]
Q4, Q7 = np.array([0.1, 1.2, 0.9, 1.4]), np.array([0.3, -0.5, 0.2, -1.5, 0.1, 1.2, 0.4])
#: The arm is nearly stretched. At the start the second task is singular. The first has a singular value of 0.012, below the default
#: threshold of "clamp". The motion passes algorithmic singularities.
STRETCHED = np.array([0.3, 0.0, 0.02, 0.01])
PROGRAMS = al.build_info()["programs"]
STEPS, DT = 120, 2e-3


def velocity(arm: al.Arm, tasks: list[al.Task], q0: Any, *map: Any, **more: Any) -> tuple[al.Plant, al.Law, Any]:
    return al.VelocityArm(arm), al.PriorityVelocity(arm, tasks, *map, **more), q0


def acceleration(arm: al.Arm, tasks: list[al.Task], q0: Any, *map: Any, **more: Any) -> tuple[al.Plant, al.Law, Any]:
    return al.RigidArm(arm), al.PriorityAcceleration(arm, tasks, *map, **more), q0


def impedance(**more: Any) -> tuple[al.Plant, al.Law, Any]:
    target = [0.4, 0.2, 0.5, 0.1, 3.0, 0.2]
    return al.RigidArm(SEVEN), al.CartesianImpedance(SEVEN, target, 200.0, 30.0, frame=TOOL, axes="xyz rx ry rz"), Q7


def pressing() -> tuple[al.Plant, al.Law, Any]:
    wall = al.Wall("link2", point=[0.75, 0.0, 0.0], normal=[-1.0, 0.0, 0.0], stiffness=1e4, damping=50.0)
    law = al.CartesianImpedance(TWO, [0.8, 0.2], [300.0, 300.0], [40.0, 40.0], frame="link2", axes="xy")
    return al.RigidArm(TWO, wall=wall), law, [0.3, 0.5]


LOOPS: dict[str, Callable[[], tuple[al.Plant, al.Law, Any]]] = {
    **{f"4R {method}": lambda method=method: velocity(FOUR, BOTH, Q4, method) for method in ("exact", "clamp", "damped")},
    **{f"4R stretched, {method}": lambda method=method: velocity(FOUR, BOTH, STRETCHED, method) for method in ("exact", "clamp", "damped")},
    "4R stretched, thresholds": lambda: velocity(FOUR, BOTH, STRETCHED, eps=[0.1, 0.3]),
    "4R accelerations": lambda: acceleration(FOUR, BOTH, Q4),
    "4R accelerations, stretched": lambda: acceleration(FOUR, BOTH, STRETCHED),
    "4R stretched, bounds": lambda: velocity(FOUR, BOTH, STRETCHED, "sns", v_max=2.0),
    "4R accelerations, bounds": lambda: acceleration(FOUR, BOTH, Q4, "sns", v_max=2.0, a_max=5.0),
    "seven axes": lambda: velocity(SEVEN, POSE, Q7),
    "seven axes, other tasks": lambda: velocity(SEVEN, ODD, Q7),
    "seven axes, accelerations": lambda: acceleration(SEVEN, POSE, Q7),
    "seven axes, accelerations, other tasks": lambda: acceleration(SEVEN, ODD, Q7),
    "orientation": impedance,
    "wall": pressing,
}
OPTIONS: list[dict[str, Any]] = [{}, {"method": "euler"}, {"sample_time": 3 * DT}]


def step_by_step(plant: al.Plant, law: al.Law, q0: Any, **options: Any) -> np.ndarray:
    """Simulate the run by single steps. Return the final q, (n,)."""
    simulator = al.Simulator(plant, law, q0, dt=DT, **options)
    for _ in range(STEPS):
        simulator.step()
    return simulator.q


# The targets are far, so that some commands pass the speed limits of the arm.
@pytest.mark.filterwarnings("ignore:.*commands pass the arm's speed limits")
@pytest.mark.parametrize("options", OPTIONS, ids=["rk4", "euler", "sampled"])
@pytest.mark.parametrize("name", LOOPS)
def test_a_program_is_the_loop(name: str, options: dict[str, Any]) -> None:
    plant, law, q0 = LOOPS[name]()
    run = al.simulate(plant, law, q0, t_end=STEPS * DT, dt=DT, **options)
    assert run.stats["engine"] != "direct"
    # The tolerance covers rounding, amplified by the large derivatives of the velocities near a singularity.
    np.testing.assert_allclose(run.q[-1], step_by_step(plant, law, q0, **options), rtol=0.0, atol=1e-9 if "stretched" in name else 1e-12)
    assert np.abs(run.q[-1] - q0).max() > 1e-3


@pytest.mark.filterwarnings("ignore:.*commands pass the arm's speed limits")
@pytest.mark.parametrize(
    "name",
    ["4R stretched, exact", "4R stretched, clamp", "4R stretched, bounds", "4R accelerations, stretched", "seven axes, accelerations"],
)
def test_rows_of_a_batch_equal_single_runs(name: str) -> None:
    """A batch has singular and regular rows. Each row equals a single run, for every order and number of threads."""
    plant, law, singular = LOOPS[name]()
    rng = np.random.default_rng(5)
    q0 = singular + np.where(np.arange(19)[:, None] % 3 > 0, rng.uniform(-1.0, 1.0, (19, plant.arm.n)), 0.0)
    options: dict[str, Any] = {"t_end": STEPS * DT, "dt": DT, "record_every": 40}
    batch = al.simulate_batch(plant, law, q0, threads=1, **options)
    assert batch.stats["engine"] == PROGRAMS
    for row in range(0, 19, 3 if plant.arm.n > 4 else 1):
        alone = al.simulate(plant, law, q0[row], **options)
        np.testing.assert_array_equal(batch.q[row], alone.q, err_msg=f"row {row}")
        np.testing.assert_array_equal(batch.tau[row], alone.tau, err_msg=f"row {row}")
        assert {name: series[row].tolist() for name, series in batch.monitors.items()} == {
            name: series.tolist() for name, series in alone.monitors.items()
        }
    order = rng.permutation(19)
    for threads in (2, 3):
        np.testing.assert_array_equal(al.simulate_batch(plant, law, q0[order], threads=threads, **options).q, batch.q[order])


def test_singular_stages_are_decided_by_native_code() -> None:
    """The algorithm for regular steps would give NaN, or velocities far beyond the bound of the method "clamp"."""
    plant, bounded = al.VelocityArm(FOUR), al.PriorityVelocity(FOUR, BOTH, "clamp", eps=0.2)
    run = al.simulate(plant, bounded, [0.3, 0.0, 0.0, 0.0], t_end=STEPS * DT, dt=DT)
    assert run.stats["engine"] == PROGRAMS and run.status == al.Status.SUCCESS
    np.testing.assert_allclose(run.q[-1], step_by_step(plant, bounded, [0.3, 0.0, 0.0, 0.0]), rtol=0.0, atol=1e-9)


def test_rows_of_other_tasks_have_other_programs() -> None:
    laws = [
        al.PriorityVelocity(FOUR, BOTH),
        al.PriorityVelocity(FOUR, BOTH[::-1]),
        al.PriorityVelocity(FOUR, BOTH, "exact"),
        al.PriorityVelocity(FOUR, [al.Task("link4", "xy", [1.3, 0.9], 4.0), BOTH[1]]),
        al.PriorityVelocity(FOUR, BOTH, eps=0.3),
        al.PriorityVelocity(FOUR, BOTH, "chiaverini"),
    ]
    options: dict[str, Any] = {"t_end": STEPS * DT, "dt": DT, "record_every": 40}
    batch = al.simulate_batch(al.VelocityArm(FOUR), laws, np.tile(Q4, (len(laws), 1)), **options)
    ends = [al.simulate(al.VelocityArm(FOUR), law, Q4, **options).q for law in laws]
    for row, end in enumerate(ends):
        np.testing.assert_array_equal(batch.q[row], end, err_msg=f"row {row}")
    assert len({end.tobytes() for end in ends}) == len(laws) - 1, "the clamp and the exact map agree away from singularities, no others"


def test_walls_at_other_frames_are_other_plants() -> None:
    walls = [
        al.Wall(frame, [at, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=1e4, damping=50.0)
        for frame, at in (("link2", 0.75), ("link1", 0.4), ("link2", 0.7))
    ]
    plants = [al.RigidArm(TWO, wall=wall) for wall in walls]
    law = pressing()[1]
    options: dict[str, Any] = {"t_end": 0.24, "dt": 1e-3, "record_every": 60}
    batch = al.simulate_batch(plants, law, [[0.3, 0.5]] * 3, **options)
    for row, plant in enumerate(plants):
        np.testing.assert_array_equal(batch.q[row], al.simulate(plant, law, [0.3, 0.5], **options).q, err_msg=f"row {row}")


@pytest.mark.parametrize("v_max", [0.2, 20.0])
def test_a_map_with_bounds_runs_as_a_program(v_max: float) -> None:
    law = al.PriorityVelocity(FOUR, BOTH, "sns", v_max=v_max)
    run = al.simulate(al.VelocityArm(FOUR), law, Q4, t_end=STEPS * DT, dt=DT)
    assert run.stats["engine"] == PROGRAMS
    most = np.abs(run.tau).max()
    assert most == v_max if v_max < 1.0 else most < v_max
    np.testing.assert_allclose(run.q[-1], step_by_step(al.VelocityArm(FOUR), law, Q4), rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", ["dopri5", "dop853"])
def test_adaptive_methods_run_priority_as_a_program(method: str) -> None:
    plant, law, q0 = LOOPS["4R stretched, clamp"]()
    run = al.simulate(plant, law, q0, t_end=2.0, method=method, rtol=1e-10, atol=1e-12, t_eval=np.linspace(0.0, 2.0, 21))
    assert run.stats["engine"] == PROGRAMS
    fixed = al.simulate(plant, law, q0, t_end=2.0, dt=1e-5, t_eval=np.linspace(0.0, 2.0, 21))
    np.testing.assert_allclose(run.q, fixed.q, rtol=0, atol=1e-7)
