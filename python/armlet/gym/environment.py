"""One arm as a Gymnasium environment: an action is a torque as a fraction of its limit, an observation is `[q, v, error]`."""

from __future__ import annotations

from typing import Any, TypeAlias

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike, NDArray

from .. import _core
from .._core import Arm, Plant
from ..border import bordered
from ..scenario import Scenario
from .rows import Rows
from .tasks import Task
from .viewer import viewer_for

__all__ = ["ArmEnv"]

Array: TypeAlias = NDArray[np.float64]


@bordered
class ArmEnv(gymnasium.Env[Array, Array]):
    """An arm under the torques of an agent, simulated by armlet's compiled loop.

    The torque `tau = tau_max * action` is constant for one period. An observation is `[q, v, error]`, (2 n + m,), with the m entries of the
    task's error. It is clipped to the observation space. `terminated` is True if the task is finished, the arm leaves its limits or the run
    diverges. `info` has the flags `reached` and `diverged`. `truncated` is True at the horizon.

    Args:
        plant: a plant; an arm (then `RigidArm(arm)`); or a `Scenario`, which gives the plant, `tau_max`, `dt`, `t_end` and the
            joint motion. None: a planar arm of two joints in a horizontal plane, and a target for its tip.
        task: `Reach`, `Track`, or a subclass of `Task`. None: `Track` with the joint motion of a `Scenario`, otherwise `Reach()`.
        tau_max: torque of an action of 1, a number or (n,), N m or N; None: that of a `Scenario`, or the arm's effort limits. For a
            `VelocityArm` it is a velocity, rad/s or m/s.
        dt: step of the integration by rk4, s; None: that of a `Scenario`, or 2 ms.
        period: time for which an action is held, s; a multiple of `dt`.
        horizon: length of a run, s, a multiple of `period`; None: `t_end` of a `Scenario`, or 5 s.
        q_limit: `(low, high)`, positions beyond which a run ends, rad or m; None: the arm's limits, and +-2 pi for joints without limits.
        v_limit: speed beyond which a run ends, rad/s or m/s; None: the arm's limits, and 20 for joints without limits.
        render_mode: "rgb_array": `render` returns a picture, (480, 480, 3). "human": each step draws in a window of matplotlib, in real
            time. None: nothing is drawn.

    Raises:
        InputError: an argument or an action has a wrong type, shape or value.
        gymnasium.error.ResetNeeded: `step` was called before `reset`, or after the end of a run.

    >>> import armlet as al
    >>> from armlet.gym import ArmEnv, Track
    >>> arm = al.planar_arm([0.5, 0.4], gravity=(0.0, 0.0))
    >>> motion = al.Sinusoid([0.0, 0.5], [0.5, 0.5], [1.0, 2.0], [0.0, 0.0])
    >>> env = ArmEnv(arm, Track(motion), tau_max=[3.0, 1.0], horizon=2.0)
    >>> observation, _ = env.reset(seed=3)
    >>> ended = False
    >>> while not ended:
    ...     e, e_dot = observation[4:6], observation[6:8]
    ...     observation, reward, terminated, truncated, info = env.step(4.0 * e + 0.4 * e_dot)
    ...     ended = terminated or truncated
    >>> truncated, reward > 0.8
    (True, True)
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 50}  # noqa: RUF012  # as in gymnasium

    def __init__(
        self,
        plant: Plant | Arm | Scenario | None = None,
        task: Task | None = None,
        *,
        tau_max: ArrayLike | None = None,
        dt: float | None = None,
        period: float = 0.02,
        horizon: float | None = None,
        q_limit: ArrayLike | None = None,
        v_limit: ArrayLike | None = None,
        render_mode: str | None = None,
    ) -> None:
        options = {"tau_max": tau_max, "dt": dt, "period": period, "horizon": horizon, "q_limit": q_limit, "v_limit": v_limit}
        self._rows = Rows(1, plant, task, **options)  # type: ignore[arg-type]  # `options` has the types of the signature
        self.observation_space, self.action_space = self._rows.observations, self._rows.actions
        self.metadata = {**self.metadata, "render_fps": 1.0 / self._rows.period}
        self._viewer = viewer_for("ArmEnv", render_mode, self.metadata["render_modes"], self._rows)
        self.render_mode = render_mode
        self._ready = self._begun = False

    @property
    def plant(self) -> Plant:
        """The plant of the environment."""
        return self._rows.plant

    @property
    def task(self) -> Task:
        """The task of the environment."""
        return self._rows.task

    @property
    def t(self) -> float:
        """Time since the last reset, s."""
        return float(self._rows.k[0]) * self._rows.period

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Start a new run. Equal seeds draw equal initial states and targets."""
        super().reset(seed=seed)
        self._rows.reset(np.zeros(1, dtype=np.int64), [self.np_random])
        self._ready = self._begun = True
        self._drawn()
        return self._rows.observe()[0], {}

    def step(self, action: ArrayLike) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Hold `action`, (n,), for one period. Entries beyond +-1 are clipped to +-1."""
        if not self._ready:
            raise ResetNeeded("ArmEnv.step: the run has not begun, or has ended: expected a call of reset before")
        reward, terminated, truncated, info = self._rows.step(_core.numbers("step", "action", action, self._rows.actions.shape)[None])
        self._ready = not (terminated[0] or truncated[0])
        self._drawn()
        flags = {name: bool(values[0]) for name, values in info.items()}
        return self._rows.observe()[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), flags

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the present state, (480, 480, 3), 0 to 255, if `render_mode` is "rgb_array"; else None.

        Lines are links, dots are joints, and the green ring is the target of the task. For `Track`, the ring is the desired position of the
        tip. A planar arm is drawn in its plane.

        Raises:
            gymnasium.error.ResetNeeded: `render` was called before `reset`.
        """
        if self._viewer is None:
            gymnasium.logger.warn("ArmEnv.render: nothing is drawn without a render_mode: expected ArmEnv(.., render_mode='rgb_array')")
            return None
        if not self._begun:
            raise ResetNeeded("ArmEnv.render: the run has not begun: expected a call of reset before")
        return self._viewer.pixels(0) if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._viewer is not None:
            self._viewer.close()

    def _drawn(self) -> None:
        if self._viewer is not None and self.render_mode == "human":
            self._viewer.show()
