"""Gymnasium environments: `check_env`, the vector environment compared with single environments, ends of runs, refused arguments."""

from __future__ import annotations

import pickle
import subprocess
import sys
from typing import Any

import gymnasium
import models
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import armlet as al
import armlet.gym
from armlet import _core
from armlet.gym import ArmEnv, ArmVectorEnv, Reach, Track

ARM = al.planar_arm([0.5, 0.4], gravity=[0.0, 0.0])
SEVEN = models.SEVEN_AXES
MOTION = al.Sinusoid([0.0, 0.5], [0.5, 0.5], [1.0, 2.0], [0.0, 0.0])
ROWS = 40

CASES: dict[str, dict[str, Any]] = {
    "default": {},
    "reach and stop": {"plant": ARM, "task": Reach(axes="xy", within=0.3, at_rest=9.0), "tau_max": 3.0, "horizon": 1.0, "v_limit": 6.0},
    "seven axes": {"plant": SEVEN, "horizon": 0.2, "v_limit": 4.0},
    "friction": {"plant": al.RigidArm(SEVEN, friction=True), "horizon": 0.2},
    "track": {"plant": ARM, "task": Track(MOTION), "tau_max": [3.0, 1.0], "horizon": 0.5, "q_limit": (-1.5, [1.5, 1.2])},
    "elastic": {"plant": al.ElasticArm(ARM, 800.0, 0.1), "task": Track(MOTION), "tau_max": 3.0, "horizon": 0.3},
    "velocity": {"plant": al.VelocityArm(ARM), "tau_max": 1.0, "horizon": 0.3},
}


@pytest.mark.parametrize("options", CASES.values(), ids=CASES.keys())
def test_environments_pass_the_checks_of_gymnasium(options: dict[str, Any]) -> None:
    """Warnings are errors, so the advice of the checker also counts."""
    check_env(gymnasium.make("armlet/Reach-v0", **options).unwrapped)


PLANTS: dict[str, al.Plant] = {
    "rigid": al.RigidArm(ARM),
    "friction": al.RigidArm(SEVEN, friction=True),
    "wall": al.RigidArm(ARM, wall=al.Wall("link2", [0.8, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=1e3)),
    "elastic": al.ElasticArm(ARM, 800.0, 0.1),
    "velocity": al.VelocityArm(ARM),
}


@pytest.mark.parametrize("rows", [1, 5, 200])
@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS.keys())
def test_rows_are_simulators(plant: al.Plant, rows: int) -> None:
    """Rows equal `al.Simulator`s to the last bit, also with angles beyond the range of the sine in compiled loops, and after restarts."""
    rng, n = np.random.default_rng(rows), plant.arm.n
    arms = _core._BatchStepper(plant, rows, 2e-3)
    q = rng.uniform(-1.0, 1.0, (rows, n))
    v = np.zeros((rows, n)) if isinstance(plant, al.VelocityArm) else rng.uniform(-1.0, 1.0, (rows, n))
    q[::4] += 1.1e6
    arms.put(range(rows), q, v)
    chosen = sorted({0, rows // 2, rows - 1})
    sims = [al.Simulator(plant, None, q[row], dt=2e-3, state_limit=np.inf, check_limits=False) for row in chosen]
    for sim, row in zip(sims, chosen, strict=True):
        sim.set_state(q[row], v[row])
    for _ in range(3):
        tau = rng.uniform(-2.0, 2.0, (rows, n))
        got = arms.step(tau, 10)
        for sim, row in zip(sims, chosen, strict=True):
            for _ in range(10):
                sim.step(tau[row])
            np.testing.assert_array_equal([got[0][row], got[1][row]], [sim.q, sim.v])
            sim.set_state(q[row], v[row])
        arms.put(chosen, q[chosen], v[chosen])


def test_rows_that_are_not_there() -> None:
    arms = _core._BatchStepper(PLANTS["rigid"], 3, 2e-3)
    with pytest.raises(al.InputError, match=r"rows is out of range: expected numbers below 3, got 3 \(first bad index 1\)"):
        arms.put([0, 3], np.ones((2, 2)), np.ones((2, 2)))
    assert not arms.states.any(), "a refused call changes no row"
    with pytest.raises(al.InputError, match=r"tau has the wrong shape: expected \(3, 2\), got \(2, 2\)"):
        arms.step(np.zeros((2, 2)), 1)
    with pytest.raises(al.InputError, match="steps is not a positive integer"):
        arms.step(np.zeros((3, 2)), 0)
    with pytest.raises(al.InputError, match="dt is not positive"):
        _core._BatchStepper(PLANTS["rigid"], 3, 0.0)
    moving = _core._BatchStepper(PLANTS["velocity"], 3, 2e-3)
    moving.step(np.full((3, 2), 0.5), 1)
    with pytest.raises(al.InputError, match="steps is not a positive integer"):
        moving.step(np.ones((3, 2)), 0)
    assert (moving.put([], np.zeros((0, 2)), np.zeros((0, 2)))[1] == 0.5).all(), "a refused call keeps the inputs"


def test_environments_are_copied_with_their_states() -> None:
    envs = ArmVectorEnv(5, al.ElasticArm(ARM, 800.0, 0.1), Track(MOTION), tau_max=3.0)
    envs.reset(seed=1)
    action = np.full((5, 2), 0.3)
    envs.step(action)
    other = pickle.loads(pickle.dumps(envs))
    np.testing.assert_array_equal(other.step(action)[0], envs.step(action)[0])


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP], ids=lambda mode: mode.value)
@pytest.mark.parametrize("options", CASES.values(), ids=CASES.keys())
def test_many_at_once_are_many_one_by_one(options: dict[str, Any], mode: AutoresetMode) -> None:
    """The vector environment equals single environments, also at ends and restarts."""
    many = ArmVectorEnv(ROWS, **options, autoreset_mode=mode)
    each = SyncVectorEnv([lambda: ArmEnv(**options)] * ROWS, autoreset_mode=mode)
    rng = np.random.default_rng(4)
    ends = 0
    np.testing.assert_array_equal(many.reset(seed=5)[0], each.reset(seed=5)[0])
    for _ in range(2 * round(options.get("horizon", 1.0) / 0.02) + 5):
        action = rng.uniform(-1.2, 1.2, (ROWS, many.action_space.shape[1]))  # type: ignore[index]  # a Box has a shape
        mine, theirs = many.step(action), each.step(action)
        for a, b in zip(mine[:4], theirs[:4], strict=True):
            np.testing.assert_array_equal(a, b)
        ends += int((mine[2] | mine[3]).sum())
        infos, wanted = mine[4], theirs[4]
        for name in ("reached", "diverged"):
            np.testing.assert_array_equal(infos[name] & infos[f"_{name}"], wanted.get(name, np.zeros(ROWS, bool)))
            np.testing.assert_array_equal(infos[f"_{name}"], wanted.get(f"_{name}", np.zeros(ROWS, bool)))
        assert ("final_obs" in infos) == ("final_obs" in wanted)
        if "final_obs" in infos:
            np.testing.assert_array_equal(infos["_final_obs"], wanted["_final_obs"])
            for row in np.flatnonzero(infos["_final_obs"]):
                np.testing.assert_allclose(infos["final_obs"][row], wanted["final_obs"][row], rtol=0.0, atol=1e-9)
            for name in ("reached", "_reached", "diverged"):
                np.testing.assert_array_equal(infos["final_info"][name], wanted["final_info"][name])
    if options:
        assert ends >= ROWS


def test_seeds_repeat_and_rows_are_their_own() -> None:
    def play(rows: int, seed: Any) -> Any:
        envs = ArmVectorEnv(rows, ARM, Reach(axes="xy"), tau_max=1.0, horizon=0.1)
        seen = [envs.reset(seed=seed)[0]]
        for k in range(12):
            seen.append(envs.step(np.full((rows, 2), 0.1 * k))[0])
        return np.array(seen)

    whole = play(40, 3)
    np.testing.assert_array_equal(play(40, 3), whole)
    np.testing.assert_array_equal(play(40, [3 + i for i in range(40)]), whole)
    np.testing.assert_array_equal(play(33, 3), whole[:, :33])
    assert not np.array_equal(play(40, 4), whole)
    env = ArmEnv(ARM, Reach(axes="xy"), tau_max=1.0)
    first = env.reset(seed=3)[0]
    np.testing.assert_array_equal(first, whole[0, 0])
    assert not np.array_equal(env.reset()[0], first)
    np.testing.assert_array_equal(env.reset(seed=3)[0], first)


class _Doubled(Reach):
    """A task with a different `draw` and `error`."""

    def draw(self, rng: np.random.Generator) -> Any:
        q0, v0, goal = super().draw(rng)
        return q0 + 0.01 * rng.random(), v0, goal

    def error(self, k: Any, q: Any, v: Any, goal: Any) -> Any:
        return 2.0 * super().error(k, q, v, goal)


@pytest.mark.parametrize("task", [Reach(), Reach(axes="zx"), Track(MOTION), _Doubled()], ids=["all axes", "two axes", "track", "own"])
def test_starts_and_errors_of_all_rows_are_those_of_each(task: Reach | Track) -> None:
    """When several rows restart together, each has the start and the error that `draw` and `error` give for one row, with equal bits."""
    envs = ArmVectorEnv(ROWS, ARM, task, tau_max=[30.0, 10.0], horizon=0.2)
    observed, _ = envs.reset(seed=3)
    own = envs._rows.task
    for row, rng in enumerate(gymnasium.utils.seeding.np_random(3 + row)[0] for row in range(ROWS)):
        q0, v0, goal = own.draw(rng)
        assert np.array_equal(observed[row], np.concatenate([q0, v0, own.error(np.zeros(1, int), q0[None], v0[None], goal[None])[0]]))
    ended = 0
    for _ in range(25):
        observed, rewards, terminated, truncated, _ = envs.step(envs.action_space.sample())
        rows = envs._rows
        error = own.error(rows.k, rows.states.q, rows.states.v, rows.goal)
        assert np.array_equal(observed[:, 4:], np.clip(error, rows.low[4:], rows.high[4:]))
        again = rows.k == 0
        assert np.array_equal(rewards[~again], own.reward(error, np.zeros((ROWS, 2)), rows.k, rows.states.q, rows.states.v)[~again])
        size = np.linalg.norm(error, axis=-1) / 0.1
        assert np.array_equal(rewards[~again], (1.0 / (1.0 + size * size))[~again])
        ended += int((terminated | truncated).sum())
    assert ended >= ROWS


def test_how_runs_end() -> None:
    """A run ends at the horizon, outside of the limits, or at the target. The last observation is in the observation space."""
    env = ArmEnv(ARM, Reach(axes="xy", spread=0.0), tau_max=1.0, horizon=0.1)
    env.reset(seed=0)
    flags = [env.step([0.0, 0.0])[2:4] for _ in range(5)]
    assert flags == [(False, False)] * 4 + [(False, True)] and env.t == pytest.approx(0.1)
    fast = ArmEnv(ARM, Reach(axes="xy"), tau_max=50.0, v_limit=2.0)
    fast.reset(seed=0)
    observation, _, terminated, truncated, info = fast.step([1.0, 1.0])
    assert (terminated, truncated, info) == (True, False, {"reached": False, "diverged": False})
    assert fast.observation_space.contains(observation)
    there = ArmEnv(ARM, Reach(axes="xy", spread=0.0, reach=0.0, within=1e-6), tau_max=1.0)
    there.reset(seed=0)
    _, reward, terminated, _, info = there.step([0.0, 0.0])
    assert terminated and info["reached"] and reward == pytest.approx(1.0)


def test_a_row_that_diverges_ends_without_changing_the_others() -> None:
    """At these speeds an rk4 step overflows. The row keeps its last finite state, and other rows keep their bits."""
    options: dict[str, Any] = {
        "plant": ARM,
        "task": Track(MOTION, spread=0.0),
        "tau_max": 1e160,
        "v_limit": 1e300,
        "q_limit": (-1e300, 1e300),
    }
    calm, wild = ArmVectorEnv(ROWS, **options), ArmVectorEnv(ROWS, **options)
    calm.reset(seed=1), wild.reset(seed=1)
    action = np.full((ROWS, 2), 1e-160)
    thrown = action.copy()
    thrown[7] = 1.0
    others = np.arange(ROWS) != 7
    expected, found = calm.step(action), wild.step(thrown)
    assert found[2].tolist() == (~others).tolist() and found[4]["diverged"].tolist() == (~others).tolist()
    assert np.isfinite(found[0]).all()
    np.testing.assert_array_equal(found[0][others], expected[0][others])
    alone = ArmEnv(**options)
    alone.reset(seed=8)
    assert alone.step(thrown[7])[4] == {"reached": False, "diverged": True}


def test_a_controller_is_paid() -> None:
    """With computed torque as the agent, the only error is that of a torque held for one period. The reward is nearly 1 per step."""
    env = ArmEnv(ARM, Track(MOTION), tau_max=10.0, period=4e-3, horizon=2.0)
    observation, _ = env.reset(seed=1)
    law = al.ComputedTorque(ARM, MOTION, kp=100.0, kd=20.0)
    paid = []
    for k in range(500):
        observation, reward, *_ = env.step(law(4e-3 * k, observation[:2], observation[2:4]) / 10.0)
        paid.append(reward)
    assert np.mean(paid[250:]) > 0.95 and paid[0] < 0.9


def test_a_scenario_is_an_environment() -> None:
    scenario = al.Scenario(
        {
            "arm": {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5},
            "motion": {"kind": "Quintic", "q0": [0.0, 0.0], "q1": [0.5, 1.0], "duration": 0.5},
            "law": {"kind": "ComputedTorque", "kp": 40.0, "kd": 20.0},
            "run": {"q0": [0.1, 0.0], "t_end": 0.6, "dt": 2e-3, "tau_max": [20.0, 5.0]},
        }
    )
    env = ArmEnv(scenario)
    assert isinstance(env.task, Track) and env.plant.arm == models.PR
    env.reset(seed=0)
    flags = [env.step([0.0, 0.0])[3] for _ in range(30)]
    assert flags == [False] * 29 + [True]


def test_reset_by_mask() -> None:
    envs = ArmVectorEnv(4, horizon=0.04, autoreset_mode="Disabled")
    start = envs.reset(seed=0)[0]
    with pytest.raises(al.InputError, match="reset_mask is no mask"):
        envs.reset(options={"reset_mask": np.zeros(4, dtype=bool)})
    envs.step(np.zeros((4, 2)))
    mask = np.array([True, False, False, True])
    after = envs.reset(seed=0, options={"reset_mask": mask})[0]
    np.testing.assert_array_equal(after[mask], start[mask])
    assert envs.step(np.zeros((4, 2)))[3].tolist() == [False, True, True, False]
    with pytest.raises(ResetNeeded, match=r"expected a reset of rows \[1, 2\] before"):
        envs.step(np.zeros((4, 2)))
    envs.reset(options={"reset_mask": ~mask})
    envs.step(np.zeros((4, 2)))


def test_actions_beyond_the_limit_are_the_limit() -> None:
    ends = []
    for action in ([1.0, -1.0], [7.0, -1.5]):
        env = ArmEnv(task=Reach(axes="xy", effort=0.1), tau_max=1.0)
        env.reset(seed=0)
        ends.append(env.step(action)[:2])
    np.testing.assert_array_equal(ends[0][0], ends[1][0])
    assert ends[0][1] == ends[1][1]


@pytest.mark.parametrize(
    ("action", "message"),
    [
        ([0.1, np.nan], r"step: action is not finite: expected finite numbers, got nan \(first bad index \(0, 1\)\)"),
        ([np.inf, 0.0], r"step: action is not finite"),
        ([0.1], r"step: action has the wrong shape: expected (\(2,\), got \(1,\)|\(1, 2\), got \(1, 1\))"),
        (["a", "b"], r"step: action is not an array of real numbers"),
    ],
)
def test_bad_actions(action: Any, message: str) -> None:
    """A refused action does not change the state."""
    env, envs = ArmEnv(), ArmVectorEnv(1)
    env.reset(seed=0), envs.reset(seed=0)
    for step, given in ((env.step, action), (envs.step, [action])):
        with pytest.raises(al.InputError, match=message):
            step(given)
    np.testing.assert_array_equal(env.step([0.5, 0.5])[0], envs.step([[0.5, 0.5]])[0][0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"plant": ARM}, "tau_max is missing"),
        ({"tau_max": -1.0}, "tau_max is out of range"),
        ({"v_limit": 0.0}, "v_limit is out of range"),
        ({"q_limit": 1.0}, "q_limit is no pair"),
        ({"q_limit": (1.0, -1.0)}, "q_limit is no range"),
        ({"period": 3e-3}, "period is no multiple of dt"),
        ({"dt": 0.0}, "period is no multiple of dt"),
        ({"horizon": 0.01}, "horizon is no multiple of period"),
        ({"task": Reach("link9")}, "link9"),
        ({"task": Reach(q0=[0.0])}, "q0 has the wrong shape"),
        ({"task": Track(al.Hold([0.0]))}, "motion has the wrong size: expected 2 joints, got 1"),
    ],
)
def test_refusals(options: dict[str, Any], message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        ArmEnv(**options)


def test_refusals_of_tasks_and_vectors() -> None:
    with pytest.raises(al.InputError, match="axes are unknown"):
        Reach(axes="xq")
    with pytest.raises(al.InputError, match="scale is out of range"):
        Reach(scale=0.0)
    with pytest.raises(al.InputError, match="num_envs is not a count"):
        ArmVectorEnv(0)
    with pytest.raises(al.InputError, match="autoreset_mode is unknown: expected one of NextStep, SameStep, Disabled"):
        ArmVectorEnv(2, autoreset_mode="x")
    with pytest.raises(al.InputError, match="seed has the wrong number of entries"):
        ArmVectorEnv(2).reset(seed=[1])
    for env in (ArmEnv(), ArmVectorEnv(2)):
        with pytest.raises(ResetNeeded, match="expected a call of reset before"):
            env.step(np.zeros(env.action_space.shape))


def test_without_gymnasium_one_line() -> None:
    code = "import sys; sys.modules['gymnasium'] = None\nimport armlet\ntry:\n import armlet.gym\nexcept ImportError as e: print(e)"
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "armlet.gym: gymnasium is not installed: pip install '.[gym]' in the folder of armlet's sources\n"
    assert armlet.gym.__name__ == "armlet.gym"
