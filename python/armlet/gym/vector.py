"""Many arms as one Gymnasium vector environment. One call advances all of them."""

from __future__ import annotations

from typing import Any, TypeAlias

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from .._core import Arm, Plant
from ..arguments import entries, instance, shown
from ..border import bordered
from ..errors import InputError
from ..scenario import Scenario
from .rows import Rows
from .tasks import Task
from .viewer import viewer_for

__all__ = ["ArmVectorEnv"]

Array: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]


@bordered
class ArmVectorEnv(VectorEnv[Array, Array, Array]):
    """`num_envs` arms that one call advances together. It replaces a `SyncVectorEnv` of `num_envs` `ArmEnv`s.

    Args:
        num_envs: the number of arms.
        plant, task, tau_max, dt, period, horizon, q_limit, v_limit: as for `ArmEnv`.
        autoreset_mode: a mode of Gymnasium. `AutoresetMode.NEXT_STEP` restarts an ended run in the next step. `SAME_STEP` restarts it in
            the same step and returns its last observation in `info["final_obs"]`. With `DISABLED`, you restart it by
            `reset(options={"reset_mask": mask})`.
        render_mode: "rgb_array": `render` returns a picture of each arm; None: nothing is drawn.

    Raises:
        InputError: an argument or an action has a wrong type, shape or value.
        gymnasium.error.ResetNeeded: `step` was called before `reset`, or, with `DISABLED`, for a run that has ended.

    >>> from armlet.gym import ArmVectorEnv
    >>> envs = ArmVectorEnv(64)
    >>> observations, infos = envs.reset(seed=0)
    >>> observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
    >>> observations.shape, rewards.shape
    ((64, 6), (64,))
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012  # as in gymnasium

    def __init__(
        self,
        num_envs: int = 1,
        plant: Plant | Arm | Scenario | None = None,
        task: Task | None = None,
        *,
        tau_max: ArrayLike | None = None,
        dt: float | None = None,
        period: float = 0.02,
        horizon: float | None = None,
        q_limit: ArrayLike | None = None,
        v_limit: ArrayLike | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
    ) -> None:
        if not isinstance(num_envs, int | np.integer) or num_envs < 1:
            raise InputError(f"ArmVectorEnv: num_envs is not a count: expected an integer >= 1, got {shown(num_envs)}")
        try:
            self._mode = AutoresetMode(autoreset_mode)
        except ValueError:
            names = ", ".join(mode.value for mode in AutoresetMode)
            raise InputError(f"ArmVectorEnv: autoreset_mode is unknown: expected one of {names}, got {shown(autoreset_mode)}") from None
        options = {"tau_max": tau_max, "dt": dt, "period": period, "horizon": horizon, "q_limit": q_limit, "v_limit": v_limit}
        self.num_envs = int(num_envs)
        self._rows = Rows(self.num_envs, plant, task, **options)  # type: ignore[arg-type]  # `options` has the types of the signature
        self.metadata = {**self.metadata, "render_fps": 1.0 / self._rows.period, "autoreset_mode": self._mode}
        self._viewer = viewer_for("ArmVectorEnv", render_mode, self.metadata["render_modes"], self._rows)
        self.render_mode = render_mode
        self.single_observation_space, self.single_action_space = self._rows.observations, self._rows.actions
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._rngs: list[np.random.Generator] = []
        self._ended = np.zeros(self.num_envs, dtype=np.bool_)
        self._ready = False

    def reset(self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Start new runs: arm i from the seed `seed + i` or `seed[i]`.

        With `options={"reset_mask": mask}`, only the arms whose entry in the mask is True restart.
        """
        if seed is None or isinstance(seed, int):
            seeds = [None if seed is None else seed + i for i in range(self.num_envs)]
        else:
            seeds = entries("ArmVectorEnv.reset", "seed", seed, self.num_envs + 1)
        if len(seeds) != self.num_envs:
            raise InputError(f"ArmVectorEnv.reset: seed has the wrong number of entries: expected {self.num_envs}, got {len(seeds)}")
        options = {} if options is None else instance("ArmVectorEnv.reset", "options", options, dict, "a table or None")
        mask = self._mask(options.get("reset_mask"))
        if not self._rngs:
            self._rngs = [seeding.np_random(each)[0] for each in seeds]
        for row in np.flatnonzero(mask):
            if seeds[row] is not None:
                self._rngs[row] = seeding.np_random(seeds[row])[0]
        self._rows.reset(np.flatnonzero(mask), self._rngs)
        self._ended[mask] = False
        self._ready = True
        return self._rows.observe(), {}

    def step(self, actions: ArrayLike) -> tuple[Array, Array, Flags, Flags, dict[str, Any]]:  # type: ignore[override]  # flags, not floats
        """Hold the actions, (num_envs, n), for one period. Entries beyond +-1 are clipped to +-1."""
        if not self._ready:
            raise ResetNeeded("ArmVectorEnv.step: the runs have not begun: expected a call of reset before")
        ended = self._ended.copy()
        if ended.any() and self._mode is AutoresetMode.DISABLED:
            raise ResetNeeded(f"ArmVectorEnv.step: runs have ended: expected a reset of rows {np.flatnonzero(ended).tolist()[:10]} before")
        rewards, terminated, truncated, info = self._rows.step(actions)
        if ended.any():
            self._rows.reset(np.flatnonzero(ended), self._rngs)
            rewards[ended] = 0.0
            for flags in (terminated, truncated, *info.values()):
                flags[ended] = False
        infos: dict[str, Any] = {}
        for name, values in info.items():
            infos |= {name: values, f"_{name}": ~ended}
        self._ended = terminated | truncated
        observations = self._rows.observe()
        if self._mode is AutoresetMode.SAME_STEP and self._ended.any():
            infos |= self._final(observations, info)
            self._rows.reset(np.flatnonzero(self._ended), self._rngs)
            observations = self._rows.observe()
            self._ended = np.zeros_like(self._ended)
        return observations, rewards, terminated, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return a picture of each arm, (480, 480, 3), as in `ArmEnv.render`; None without a `render_mode`.

        Raises:
            gymnasium.error.ResetNeeded: `render` was called before `reset`.
        """
        if self._viewer is None:
            gymnasium.logger.warn("ArmVectorEnv.render: nothing is drawn without a render_mode: expected render_mode='rgb_array'")
            return None
        if not self._ready:
            raise ResetNeeded("ArmVectorEnv.render: the runs have not begun: expected a call of reset before")
        return tuple(self._viewer.pixels(row) for row in range(self.num_envs))

    def _final(self, observations: Array, info: dict[str, Flags]) -> dict[str, Any]:
        """The entries of `info` with the last observations and flags of the runs that end in this step.

        The other entries of `info` are valid only for the runs that continue.
        """
        ended = self._ended
        last = np.full(self.num_envs, None, dtype=object)
        for row in np.flatnonzero(ended):
            last[row] = observations[row].copy()
        found: dict[str, Any] = {"final_obs": last, "_final_obs": ended.copy(), "_final_info": ended.copy()}
        final = {name: flags & ended for name, flags in info.items()}
        found["final_info"] = final | {f"_{name}": ended.copy() for name in info}
        return found | {name: flags & ~ended for name, flags in info.items()} | {f"_{name}": ~ended for name in info}

    def _mask(self, given: Any) -> Flags:
        if given is None:
            return np.ones(self.num_envs, dtype=np.bool_)
        mask: Flags = np.zeros(0, dtype=np.bool_) if isinstance(given, np.ma.MaskedArray) else np.asarray(given)
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise InputError(
                f"ArmVectorEnv.reset: reset_mask is no mask: expected ({self.num_envs},) booleans, one at least True, got {shown(given)}"
            )
        return mask
