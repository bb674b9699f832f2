"""Types of the extension module; checked against it by stubtest."""

from collections.abc import Sequence
from typing import Any, Self, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

__version__: str

def build_info() -> dict[str, Any]: ...
def statuses() -> list[tuple[int, str, str]]: ...
def planar_pr(A: float, B: float, C: float) -> Arm: ...
def _restore_planar_pr(pi: Sequence[float]) -> Arm: ...
def simulate(
    plant: RigidArm,
    law: Law,
    q0: ArrayLike,
    v0: ArrayLike | None,
    t_end: float,
    dt: float | None,
    method: str,
    rtol: float,
    atol: float,
    sample_time: float | None,
    record_every: int,
    t_eval: ArrayLike | None,
    tau_max: ArrayLike | None,
    monitors: bool,
) -> dict[str, Any]: ...
def simulate_batch(
    plant: RigidArm | Sequence[RigidArm],
    law: Law | Sequence[Law],
    q0: ArrayLike,
    v0: ArrayLike | None,
    t_end: float,
    dt: float | None,
    method: str,
    rtol: float,
    atol: float,
    sample_time: float | None,
    record_every: int,
    t_eval: ArrayLike | None,
    tau_max: ArrayLike | None,
    monitors: bool,
    threads: int | None,
    keep: str,
) -> dict[str, Any]: ...

@final
class Arm:
    @property
    def n(self) -> int: ...
    @property
    def joint_names(self) -> tuple[str, ...]: ...
    @property
    def joint_types(self) -> tuple[str, ...]: ...
    @property
    def frame_names(self) -> tuple[str, ...]: ...
    @property
    def parameters(self) -> Array: ...
    @property
    def report(self) -> tuple[str, ...]: ...
    def with_parameters(self, pi: ArrayLike) -> Arm: ...
    def mass_matrix(self, q: ArrayLike, *, out: Array | None = None) -> Array: ...
    def coriolis_matrix(self, q: ArrayLike, v: ArrayLike, *, out: Array | None = None) -> Array: ...
    def gravity(self, q: ArrayLike, *, out: Array | None = None) -> Array: ...
    def bias(self, q: ArrayLike, v: ArrayLike, *, out: Array | None = None) -> Array: ...
    def inverse_dynamics(self, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, out: Array | None = None) -> Array: ...
    def forward_dynamics(self, q: ArrayLike, v: ArrayLike, tau: ArrayLike, *, out: Array | None = None) -> Array: ...
    def regressor(self, q: ArrayLike, v: ArrayLike, v_r: ArrayLike, a_r: ArrayLike, *, out: Array | None = None) -> Array: ...
    def energy(self, q: ArrayLike, v: ArrayLike) -> tuple[Array, Array]: ...
    def pose(self, q: ArrayLike, frame: str) -> Array: ...
    def position(self, q: ArrayLike, frame: str) -> Array: ...
    def jacobian(self, q: ArrayLike, frame: str) -> Array: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self, /) -> int: ...

@final
class RigidArm:
    def __new__(cls, arm: Arm) -> Self: ...
    @property
    def arm(self) -> Arm: ...
    def __getnewargs__(self) -> tuple[Arm]: ...

class Motion:
    @property
    def n(self) -> int: ...
    def __call__(self, /, t: float) -> tuple[Array, Array, Array]: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class Hold(Motion):
    def __new__(cls, q: ArrayLike) -> Self: ...

@final
class Sinusoid(Motion):
    def __new__(cls, offset: ArrayLike, amplitude: ArrayLike, frequency: ArrayLike, phase: ArrayLike) -> Self: ...

@final
class Quintic(Motion):
    def __new__(cls, q0: ArrayLike, q1: ArrayLike, duration: float) -> Self: ...

@final
class BangBang(Motion):
    def __new__(cls, q0: ArrayLike, q1: ArrayLike, duration: float) -> Self: ...

@final
class Table(Motion):
    def __new__(cls, dt: float, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, start: float | None = None) -> Self: ...

class Law:
    @property
    def arm(self) -> Arm: ...
    @property
    def motion(self) -> Motion: ...
    def __call__(
        self,
        /,
        t: float,
        q: ArrayLike,
        v: ArrayLike,
        *,
        theta: ArrayLike | None = None,
        theta_dot: ArrayLike | None = None,
        state: ArrayLike | None = None,
    ) -> Array: ...
    def terms(
        self,
        t: float,
        q: ArrayLike,
        v: ArrayLike,
        *,
        theta: ArrayLike | None = None,
        theta_dot: ArrayLike | None = None,
        state: ArrayLike | None = None,
    ) -> dict[str, Array]: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class Adaptive(Law):
    def __new__(
        cls, arm: Arm, motion: Motion, kp: ArrayLike, kd: ArrayLike, gamma: ArrayLike, *, estimate: ArrayLike | None = None
    ) -> Self: ...

@final
class ComputedTorque(Law):
    def __new__(cls, arm: Arm, motion: Motion, kp: ArrayLike, kd: ArrayLike) -> Self: ...
