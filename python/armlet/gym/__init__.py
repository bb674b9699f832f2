"""Gymnasium environments of arms: `ArmEnv` simulates one arm, `ArmVectorEnv` many arms. It requires gymnasium (extra `gym`).

Importing this module registers `armlet/Reach-v0`, a planar arm of two joints whose tip moves to a random target.

>>> import gymnasium
>>> import armlet.gym
>>> env = gymnasium.make("armlet/Reach-v0")
>>> observation, info = env.reset(seed=1)
>>> observation.shape, env.action_space.shape
((6,), (2,))
>>> many = gymnasium.make_vec("armlet/Reach-v0", num_envs=100)
>>> many.reset(seed=1)[0].shape
(100, 6)
"""

from __future__ import annotations

from ..extras import missing

try:
    import gymnasium
except ImportError:
    raise missing("armlet.gym", "gymnasium", "gym") from None

from .environment import ArmEnv
from .tasks import Reach, Task, Track
from .vector import ArmVectorEnv

__all__ = ["ArmEnv", "ArmVectorEnv", "Reach", "Task", "Track"]

if "armlet/Reach-v0" not in gymnasium.registry:
    gymnasium.register("armlet/Reach-v0", entry_point="armlet.gym:ArmEnv", vector_entry_point="armlet.gym:ArmVectorEnv")
