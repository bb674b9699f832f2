"""Dry friction of plants: refused arguments, stored arguments, and the places that accept friction models."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet.errors import InputError
from armlet.gym import ArmVectorEnv
from armlet.interop import to_control
from armlet.scenario import Scenario

ARM = models.TWO_LINKS
LUGRE: dict[str, Any] = {"coulomb": 2.0, "static": 3.0, "stribeck_speed": 0.05, "stiffness": 200.0, "damping": 2.0, "viscous": 0.5}
STICKS: dict[str, Any] = {"coulomb": [2.0, 1.0], "static": [3.0, 1.5], "stribeck_speed": 0.05, "load_ratio": 0.1}
LAW = al.PDGravity(ARM, [0.5, -0.3], 60.0, 8.0)


def rigid(friction: Any) -> al.Plant:
    return al.RigidArm(ARM, friction=friction)


def elastic(friction: Any) -> al.Plant:
    return al.ElasticArm(ARM, [800.0, 500.0], [0.4, 0.25], motor_friction=friction)


BAD = [
    ({"coulomb": -1.0}, r"coulomb .*>= 0, got -1 \(first bad index 0\)"),
    ({"coulomb": [1.0, np.nan]}, r"coulomb .*first bad index 1"),
    ({"coulomb": [1.0, 2.0, 3.0]}, r"coulomb .*shape.*\(2,\)"),
    ({"static": [2.0, 1.9]}, r"static .*at least coulomb, got 1\.9 \(first bad index 1\)"),
    ({"static": np.inf}, r"static .*finite"),
    ({"stribeck_speed": -0.1}, r"stribeck_speed .*>= 0, got -0\.1"),
    ({"viscous": [0.0, -2.0]}, r"viscous .*>= 0, got -2 \(first bad index 1\)"),
    ({"load_ratio": [0.1, 1.0]}, r"load_ratio .*< 1, got 1 \(first bad index 1\)"),
]
BAD_BRISTLES = [
    ({"coulomb": [2.0, 0.0]}, r"coulomb .*> 0, got 0 \(first bad index 1\)"),
    ({"stiffness": 0.0}, r"stiffness .*> 0, got 0"),
    ({"damping": [0.0, -1.0]}, r"damping .*>= 0, got -1 \(first bad index 1\)"),
    ({"stribeck_speed": None}, r"stribeck_speed .*where static exceeds coulomb, got 0"),
]


@pytest.mark.parametrize(("make", "name"), [(rigid, "friction"), (elastic, "motor_friction")])
def test_bad_numbers_are_refused_by_name(make: Any, name: str) -> None:
    for given, problem in BAD:
        for kind, numbers in ((al.StickSlip, {"coulomb": 2.0}), (al.LuGre, LUGRE)):
            with pytest.raises(InputError, match=rf"{name}\.{problem}"):
                make(kind(**numbers | given))
    for given, problem in BAD_BRISTLES:
        with pytest.raises(InputError, match=rf"{name}\.{problem}"):
            make(al.LuGre(**LUGRE | given))


@pytest.mark.parametrize("kind", [al.LuGre, al.StickSlip])
def test_arguments_that_are_no_numbers_are_refused(kind: Any) -> None:
    for wrong in ("2", [[1.0]], 1j, object()):
        with pytest.raises(InputError, match="coulomb"):
            kind(**{**(LUGRE if kind is al.LuGre else {}), "coulomb": wrong})
    with pytest.raises(TypeError):
        kind(2.0)
    with pytest.raises(InputError, match="friction"):
        rigid("stick-slip")


@pytest.mark.parametrize("model", [al.LuGre(**LUGRE), al.StickSlip(**STICKS)])
def test_models_and_plants_are_kept(model: Any) -> None:
    for plant in (rigid(model), elastic(model)):
        for again in (pickle.loads(pickle.dumps(plant)), copy.deepcopy(plant)):
            assert repr(again) == repr(plant) and type(model).__name__ in repr(plant)
    assert pickle.loads(pickle.dumps(model)) == model
    assert eval(repr(model), {type(model).__name__: type(model)}) == model


@pytest.mark.parametrize("model", [al.LuGre(**LUGRE), al.StickSlip(**STICKS)])
@pytest.mark.parametrize("options", [{"dt": 1e-3}, {"method": "dopri5", "t_eval": np.linspace(0.0, 0.5, 51)}])
def test_rows_of_batches_are_runs(model: Any, options: dict[str, Any]) -> None:
    starts = np.random.default_rng(1).uniform(-0.5, 0.5, (11, 2))
    options = {"t_end": 0.5, "force": [1.0, 2.0, 0.0], "force_frame": "link2", **options}
    plants: list[tuple[Any, Any]] = [(rigid(model), LAW)]
    plants.append((elastic(model), al.MotorPD(ARM, [0.5, -0.3], 60.0, 8.0, [800.0, 500.0])))
    for plant, law in plants:
        batch = al.simulate_batch(plant, law, starts, **options)
        assert batch.friction is not None and batch.friction.shape == batch.q.shape
        assert (batch.bristles is None) == isinstance(model, al.StickSlip)
        for i in (0, 4, 10):
            run = al.simulate(plant, law, starts[i], **options)
            for name in ("q", "v", "friction", "bristles"):
                mine, theirs = getattr(run, name), getattr(batch[i], name)
                # Batches and single runs may differ by rounding, which damped loops do not amplify.
                assert mine is theirs is None or np.allclose(mine, theirs, rtol=0.0, atol=1e-10), name
            assert np.allclose(run.monitors["energy_balance"], batch[i].monitors["energy_balance"], atol=1e-10)


@pytest.mark.parametrize("other", [False, al.StickSlip(**STICKS), al.LuGre(**LUGRE)])
@pytest.mark.parametrize("model", [al.LuGre(**LUGRE), al.StickSlip(**STICKS)])
def test_batches_mix_no_models(model: Any, other: Any) -> None:
    plants = [rigid(model), *[rigid(other)] * 7]
    for order in (plants, plants[::-1]):
        if type(other) is type(model):
            assert len(al.simulate_batch(order, LAW, np.zeros((8, 2)), t_end=0.01, dt=1e-3, monitors=False)) == 8
            continue
        with pytest.raises(InputError, match="plant mixes models of friction"):
            al.simulate_batch(order, LAW, np.zeros((8, 2)), t_end=0.01, dt=1e-3)


def test_runs_keep_their_friction(tmp_path: Path) -> None:
    run = al.simulate(rigid(al.LuGre(**LUGRE)), LAW, [0.0, 0.0], t_end=0.1, dt=1e-3)
    run.save(tmp_path / "run.npz")
    again = al.load(tmp_path / "run.npz")
    assert run.bristles is not None and run.friction is not None
    assert np.array_equal(again.friction, run.friction) and np.array_equal(again.bristles, run.bristles)
    assert {"friction1", "friction2", "bristles1", "bristles2"} <= set(run.to_pandas().columns)
    plain = al.simulate(al.RigidArm(ARM, friction=True), LAW, [0.0, 0.0], t_end=0.1, dt=1e-3)
    assert plain.friction is plain.bristles is None


@pytest.mark.parametrize("model", [al.LuGre(**LUGRE), al.StickSlip(**STICKS)])
@pytest.mark.parametrize("method", ["rk4", "semi_implicit", "ros2"])
def test_steps_by_hand_are_those_of_a_run(model: Any, method: str) -> None:
    plant = rigid(model)
    run = al.simulate(plant, LAW, [0.0, 0.0], t_end=0.5, dt=1e-3, method=method, monitors=False)
    sim = al.Simulator(plant, LAW, [0.0, 0.0], dt=1e-3, method=method)
    for _ in range(500):
        sim.step()
    assert np.allclose(sim.q, run.q[-1], rtol=0.0, atol=1e-12)
    if isinstance(model, al.StickSlip):
        assert sim.bristles is None
        with pytest.raises(InputError, match="bristles is not used"):
            sim.set_state([0.0, 0.0], [0.0, 0.0], bristles=[0.0, 0.0])
        return
    assert run.bristles is not None
    assert np.allclose(sim.bristles, run.bristles[-1], rtol=0.0, atol=1e-12)
    again = pickle.loads(pickle.dumps(sim))
    again.step(), sim.step()
    assert np.array_equal(again.state["bristles"], sim.state["bristles"])
    sim.set_state([0.1, 0.2], [0.0, 0.0], bristles=[1e-4, 0.0])
    assert np.array_equal(sim.bristles, [1e-4, 0.0])
    sim.set_state([0.1, 0.2], [0.0, 0.0])
    assert np.array_equal(sim.bristles, [0.0, 0.0])
    with pytest.raises(InputError, match="bristles"):
        sim.set_state([0.1, 0.2], [0.0, 0.0], bristles=[np.nan, 0.0])


def test_events_and_polynomials_leave_bristles_out() -> None:
    plant = rigid(al.LuGre(**LUGRE))
    seen: list[int] = []

    def count(*arguments: Any) -> float:
        seen.append(len(arguments))
        return 1.0

    law = al.PID(ARM, [0.5, -0.3], 60.0, 20.0, 8.0)
    events = [al.Event.speed(0, 0.1), count]
    run = al.simulate(plant, law, [0.0, 0.0], t_end=0.3, method="dopri5", events=events, dense=True)
    assert set(seen) == {3} and run.events is not None and run.events.theta is None
    state = run.sample(run.t)
    assert np.allclose(state.q, run.q, atol=1e-12) and np.allclose(state.estimate, run.estimate, atol=1e-9) and state.theta is None


@pytest.mark.parametrize("model", [al.LuGre(**LUGRE), al.StickSlip(**STICKS)])
def test_environments_step_such_plants(model: Any) -> None:
    """A row of an environment has the states of a `Simulator` under equal torques."""
    plant = rigid(model)
    environment = ArmVectorEnv(3, plant, tau_max=20.0)
    environment.reset(seed=1)
    sim = al.Simulator(plant, None, [0.0, 0.0], dt=2e-3)
    start = np.array(environment.unwrapped._rows.states.q)
    sim.reset(start[1], [0.0, 0.0])
    rows = environment.unwrapped._rows
    rows.states.reset(np.arange(3), start, np.zeros_like(start))
    rows.states.step(np.full((3, 2), 4.0))
    for _ in range(rows.steps):
        sim.step([4.0, 4.0])
    assert np.allclose(rows.states.q[1], sim.q, rtol=0.0, atol=1e-12)


def test_features_that_need_smooth_plants_refuse_dry_friction() -> None:
    sticks, bends = rigid(al.StickSlip(**STICKS)), rigid(al.LuGre(**LUGRE))
    for plant in (sticks, bends, elastic(al.LuGre(**LUGRE))):
        with pytest.raises(InputError, match="dry friction"):
            to_control(plant)
    options: dict[str, Any] = {"t_end": 0.1, "dt": 1e-3}
    with pytest.raises(InputError, match="stick-slip"):
        al.simulate(sticks, LAW, [0.0, 0.0], sensitivity=["law.kp"], **options)
    for method in ("rk4", "dopri5", "radau5", "ros2"):
        steps: dict[str, Any] = {"dt": 1e-3} if method in ("rk4", "ros2") else {}
        assert al.simulate(bends, LAW, [0.0, 0.0], t_end=0.1, method=method, **steps).stats["engine"] != "direct"


def test_derivatives_of_runs_with_bristles() -> None:
    """Derivatives with respect to friction parameters equal differences of runs."""
    options: dict[str, Any] = {"t_end": 0.2, "dt": 1e-4, "monitors": False}
    names = ["plant.friction.coulomb", "plant.friction.stiffness", "law.kp"]
    run = al.simulate(rigid(al.LuGre(**LUGRE)), LAW, [0.0, 0.0], sensitivity=names, **options)
    assert run.sensitivity is not None

    def moved(number: str, by: float) -> Any:
        friction = al.LuGre(**LUGRE | {number: LUGRE[number] + by})
        return al.simulate(rigid(friction), LAW, [0.0, 0.0], **options)

    for number in ("coulomb", "stiffness"):
        step = 1e-5 * LUGRE[number]
        above, below = moved(number, step), moved(number, -step)
        for name in ("q", "bristles"):
            slope = (getattr(above, name)[-1] - getattr(below, name)[-1]) / (2.0 * step)
            found = getattr(run.sensitivity[f"plant.friction.{number}"], name)[-1, :, 0]
            # Central differences with step 1e-5 err by 1e-10 times the third derivative, plus rounding of 1e-16/1e-5.
            assert np.allclose(found, slope, rtol=1e-6, atol=1e-11 / LUGRE[number])
            assert np.abs(found).max() > 0.0


SCENARIO = """
[arm]
kind = "planar_arm"
lengths = [0.5, 0.4]
[plant]
kind = "{plant}"
{more}
[plant.{name}]
kind = "{kind}"
coulomb = [2.0, 1.0]
{numbers}
[law]
kind = "{law}"
target = [0.5, -0.3]
kp = 60.0
kd = 8.0
{law_more}
[run]
q0 = [0.0, 0.0]
t_end = 0.2
dt = 1e-3
"""


@pytest.mark.parametrize("kind", ["LuGre", "StickSlip"])
@pytest.mark.parametrize("plant", ["RigidArm", "ElasticArm"])
def test_scenarios(tmp_path: Path, kind: str, plant: str) -> None:
    springs = plant == "ElasticArm"
    fields = {
        "plant": plant,
        "kind": kind,
        "name": "motor_friction" if springs else "friction",
        "numbers": "stiffness = 200.0\ndamping = 2.0" if kind == "LuGre" else "static = 2.5",
        "more": "stiffness = [800.0, 500.0]\nmotor_inertia = [0.4, 0.25]" if springs else "",
        "law": "MotorPD" if springs else "PDGravity",
        "law_more": "joint_stiffness = [800.0, 500.0]" if springs else "",
    }
    file = tmp_path / "friction.toml"
    file.write_text(SCENARIO.format(**fields))
    run = Scenario.load(file).run()
    assert run.friction is not None and (run.bristles is not None) == (kind == "LuGre")
    for wrong, problem in (("coulomb = -1.0", "coulomb"), ("bristle = 1.0", "bristle"), ('kind = "Dahl"', "kind")):
        text = SCENARIO.format(**fields).replace("coulomb = [2.0, 1.0]" if wrong != 'kind = "Dahl"' else f'kind = "{kind}"', wrong)
        file.write_text(text)
        with pytest.raises(InputError, match=problem):
            Scenario.load(file).run()
