"""Pictures of environments: Gymnasium's check of `render`, the drawn objects, windows, and refused arguments."""

from __future__ import annotations

import pickle
import sys
from typing import Any

import gymnasium
import matplotlib
import models
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

import armlet as al
from armlet.figures.skeleton import Picture
from armlet.gym import ArmEnv, ArmVectorEnv, Reach, Track, viewer

ARM = al.planar_arm([0.5, 0.4], gravity=[0.0, 0.0])
SEVEN = models.SEVEN_AXES
MOTION = al.Sinusoid([0.0, 0.5], [0.5, 0.5], [1.0, 2.0], [0.0, 0.0])


@pytest.fixture(autouse=True)
def without_windows() -> None:
    matplotlib.use("agg")


@pytest.mark.parametrize("mode", ["rgb_array", "human"])
def test_gymnasium_checks_render(mode: str) -> None:
    """Warnings are errors. The frame rate in `metadata` is one frame per period of the environment."""
    env = gymnasium.make("armlet/Reach-v0", render_mode=mode, period=0.05).unwrapped
    check_env(env)
    assert env.metadata["render_fps"] == 20.0 and env.render_mode == mode
    env.close()


def test_the_picture_follows_the_arm() -> None:
    env = ArmEnv(SEVEN, Reach("tcp"), render_mode="rgb_array")
    env.reset(seed=1)
    before = env.render()
    again = env.render()
    assert before is not None and again is not None and before.shape == (480, 480, 3) and before.dtype == np.uint8
    np.testing.assert_array_equal(before, again)
    for _ in range(10):
        env.step(np.full(7, 0.05))
    after, copied = env.render(), pickle.loads(pickle.dumps(env)).render()
    assert after is not None and (after != before).any()
    np.testing.assert_array_equal(copied, after)


@pytest.mark.parametrize("task", [Reach(axes="xy"), Reach(axes="x"), Track(MOTION)], ids=["xy", "x", "track"])
def test_targets_are_drawn(task: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The drawn target minus the tip is the observed error. Along a free axis the target is drawn at the tip."""
    seen: list[Any] = []
    monkeypatch.setattr(Picture, "show", lambda self, lines, k, title, targets: seen.append((lines.tip[0], title, targets)))
    monkeypatch.setattr(Picture, "pixels", lambda self: np.zeros((2, 2, 3), dtype=np.uint8))
    envs = ArmVectorEnv(3, ARM, task, tau_max=3.0, render_mode="rgb_array")
    envs.reset(seed=1)
    observed = envs.step(np.full((3, 2), 0.4))[0]
    pictures = envs.render()
    assert pictures is not None and len(pictures) == len(seen) == 3
    for (tip, title, targets), row in zip(seen, observed, strict=True):
        assert title == "t = 0.02 s" and targets.shape == (1, 3)
        np.testing.assert_allclose(tip, ARM.position(row[:2], "link2"), atol=1e-15)
        if isinstance(task, Track):
            np.testing.assert_allclose(targets[0], ARM.position(row[:2] + row[4:6], "link2"), atol=1e-14)
        else:
            error = np.zeros(3)
            error[: len(row) - 4] = row[4:]
            np.testing.assert_allclose(targets[0] - tip, error, atol=1e-15)


class Clock:
    """A clock that advances only by `sleep`."""

    def __init__(self) -> None:
        self.now = 7.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def test_a_window_keeps_the_pace_of_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each step waits until its real time: 10 steps of 50 ms take 0.5 s."""
    from matplotlib import pyplot

    before = set(pyplot.get_fignums())
    env = ArmEnv(ARM, tau_max=1.0, period=0.05, horizon=1.0, render_mode="human")
    clock = Clock()
    monkeypatch.setattr(viewer, "time", clock)
    env.reset(seed=1)
    for _ in range(10):
        env.step([0.1, 0.1])
    assert clock.now == pytest.approx(7.5)
    assert env.render() is None and len(set(pyplot.get_fignums()) - before) == 1
    env.close()
    assert set(pyplot.get_fignums()) == before


def test_vector_environments_by_name() -> None:
    envs = gymnasium.make_vec("armlet/Reach-v0", num_envs=2, render_mode="rgb_array")
    envs.reset(seed=0)
    pictures: Any = envs.render()
    assert pictures is not None and [picture.shape for picture in pictures] == [(480, 480, 3)] * 2
    assert (pictures[0] != pictures[1]).any() and envs.metadata["render_fps"] == 50.0


def test_refusals(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(al.InputError, match="ArmEnv: render_mode is unknown: expected one of human, rgb_array or None, got 'ansi'"):
        ArmEnv(render_mode="ansi")
    with pytest.raises(al.InputError, match="ArmVectorEnv: render_mode is unknown: expected one of rgb_array or None, got 'human'"):
        ArmVectorEnv(2, render_mode="human")
    for env in (ArmEnv(render_mode="rgb_array"), ArmVectorEnv(2, render_mode="rgb_array")):
        with pytest.raises(ResetNeeded, match=r"render: the run.* not begun"):
            env.render()
    for silent in (ArmEnv(), ArmVectorEnv(2)):
        with pytest.warns(UserWarning, match="nothing is drawn without a render_mode"):
            assert silent.render() is None
    pr = models.PR
    with pytest.raises(al.InputError, match="ArmEnv: arm has nothing to draw"):
        ArmEnv(pr, Track(al.Hold([0.0, 0.0])), tau_max=1.0, render_mode="rgb_array")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match=r"ArmEnv: matplotlib is not installed: pip install '\.\[plot\]'"):
        ArmEnv(render_mode="rgb_array")
