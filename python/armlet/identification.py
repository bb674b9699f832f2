"""The results of `Arm.base_parameters`, `Arm.check_parameters` and `Arm.identify`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arguments import positive
from .border import bordered
from .pickling import sealed

if TYPE_CHECKING:
    from ._core import Arm

_Array = NDArray[np.float64]


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class BaseParameters:
    """The smallest set of combinations of parameters that determines the motion of an arm: `Y pi = Y_b (P pi)`.

    `Y` is the regressor, `pi` the vector of all parameters, and `Y_b` consists of some columns of `Y`. The base parameters are `P pi`.

    >>> import armlet as al
    >>> base = al.planar_arm([1.0, 1.0]).base_parameters()
    >>> base.count
    6
    >>> print(base)
    6 base parameters of 20
      mcx[joint1] + m[joint2]
      mcy[joint1]
      Izz[joint1] + m[joint2]
      mcx[joint2]
      mcy[joint2]
      Izz[joint2]
    """

    arm: Arm
    #: Indices of the regressor's columns in `Y_b`, (b,).
    columns: NDArray[np.intp]
    #: The matrix `P`, (b, p), which maps all parameters to base parameters.
    projection: _Array
    #: Names of all p parameters.
    names: tuple[str, ...]
    #: Each of the b base parameters as a sum of parameters.
    grouping: tuple[str, ...]
    #: Parameters that do not affect the motion.
    unseen: tuple[str, ...]
    #: Whether the parameters include rotor inertias (`armature`), and damping and Coulomb friction (`friction`).
    armature: bool
    friction: bool
    #: A column of the regressor is dropped if its relative distance from the span of the earlier columns is zero up to rounding. These are
    #: the smallest distance of a kept column, and the largest distance of a dropped column.
    smallest_kept: float
    largest_dropped: float
    #: Whether the parameters include torque offsets.
    offset: bool = False

    @property
    def count(self) -> int:
        """The number b of base parameters."""
        return len(self.columns)

    @property
    def values(self) -> _Array:
        """The base parameters of the arm with its present parameters, (b,), in SI units. Torque offsets are zero."""
        limits = self.arm.limits
        extra = [limits["armature"]] if self.armature else []
        extra += [limits["damping"], limits["friction"]] if self.friction else []
        extra += [np.zeros(self.arm.n)] if self.offset else []
        values: _Array = self.projection @ np.concatenate([self.arm.parameters, *extra])
        return values

    def regressor(self, q: ArrayLike, v: ArrayLike, v_r: ArrayLike, a_r: ArrayLike) -> _Array:
        """Compute the columns of the Slotine-Li regressor for the base parameters.

        Args:
            q, v, v_r, a_r: positions, velocities, reference velocities and reference accelerations, (..., n), as for `Arm.regressor`.

        Returns:
            The columns, (..., n, b).
        """
        full = self.arm.regressor(q, v, v_r, a_r, armature=self.armature, friction=self.friction, offset=self.offset)
        return np.ascontiguousarray(full[..., self.columns])

    def __str__(self) -> str:
        lines = [f"{self.count} base parameters of {len(self.names)}", *(f"  {line}" for line in self.grouping)]
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<BaseParameters: {self.count} of {len(self.names)}>"


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class ParameterReport:
    """Report whether every body of a parameter vector is physically possible: its 4 x 4 pseudo-inertia is positive definite.

    >>> import armlet as al
    >>> arm = al.planar_arm([1.0])
    >>> pi = arm.parameters
    >>> pi[0] = -1.0
    >>> print(arm.check_parameters(pi))
    joint1: mass -1 is not positive (smallest eigenvalue of the pseudo-inertia -1.17)
    """

    #: Names of the joints that move the bodies.
    joints: tuple[str, ...]
    #: Eigenvalues of the pseudo-inertia of each body, (bodies, 4), ascending.
    eigenvalues: _Array
    #: The problem of each body; empty for a physically possible body.
    problems: tuple[str, ...]

    @property
    def consistent(self) -> bool:
        """Whether every body is physically possible."""
        return not any(self.problems)

    @property
    def inconsistent(self) -> tuple[str, ...]:
        """Names of the joints whose bodies are physically impossible."""
        return tuple(joint for joint, problem in zip(self.joints, self.problems, strict=True) if problem)

    def __bool__(self) -> bool:
        return self.consistent

    def __str__(self) -> str:
        lines = [
            f"{joint}: {problem} (smallest eigenvalue of the pseudo-inertia {eigenvalues[0]:.3g})"
            for joint, problem, eigenvalues in zip(self.joints, self.problems, self.eigenvalues, strict=True)
            if problem
        ]
        return "\n".join(lines) or f"all {len(self.joints)} bodies are physically possible"

    def __repr__(self) -> str:
        return f"<ParameterReport: {len(self.inconsistent)} of {len(self.joints)} bodies impossible>"


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class Identification:
    """Base parameters identified from a record of motion and torque, with their standard deviations."""

    base: BaseParameters
    #: Estimates of the base parameters, (b,).
    values: _Array
    #: Standard deviations of the estimates, (b,); infinite for undetermined parameters.
    deviations: _Array
    #: Covariance of the estimates, (b, b).
    covariance: _Array
    #: The number of combinations of base parameters that the record determines.
    rank: int
    #: Condition number of the weighted regressor of the base parameters with columns scaled to norm one; infinite if the rank is less than
    #: b.
    condition: float
    #: Singular values of this scaled regressor, (b,), descending.
    singular_values: _Array
    #: Root mean square of the torque that the model does not explain, for each joint, (n,), N m or N.
    residuals: _Array
    #: All parameters, (p,), in the order of `base.names`. Of all vectors with these base parameters, this one is nearest to the arm's
    #: parameters.
    parameters: _Array

    @property
    def arm(self) -> Arm:
        """The arm with the identified inertial parameters.

        It also has the identified rotor inertias, damping and Coulomb friction, if the identification included them.
        """
        arm = self.base.arm.with_parameters(self.parameters[: self.base.arm.parameters.size])
        drives = {kind: values for kind, values in self._of_joints.items() if kind != "offset"}
        return arm.with_drives(**drives) if drives else arm

    def with_prior(self, spread: float = 0.3) -> _Array:
        """Combine the estimates with the parameters of the arm, each weighted by its standard deviation.

        Let `r` be the radius of gyration of a body of mass `m` about the origin of its frame. The standard deviations of the arm's
        parameters are `spread m` for the mass, `spread m r` for first moments and `spread m r^2` for entries of the inertia tensor. That of
        a parameter `x` of `planar_pr` is `spread |x|`. So a combination that hardly
        affects the torque keeps the value of the arm, although its estimate is noise. Parameters of the joints keep their estimates.

        Args:
            spread: relative standard deviation of the parameters of the arm, > 0.

        Returns:
            The most probable parameters, (p,), in the order of `base.names`. They may be inconsistent: see `Arm.project_parameters`.

        Raises:
            InputError: `spread` is not a positive number.
        """
        spread = positive("Identification.with_prior", "spread", spread)
        own = self.base.arm.parameters
        joints = self.parameters[own.size :]
        # A standard deviation beyond every plausible value of a parameter of a joint is no prior.
        variance = np.concatenate([spread * _scale(own), 1e3 * (1.0 + np.abs(joints))]) ** 2
        before = np.concatenate([own, joints])
        known = np.isfinite(self.deviations)
        rows = self.base.projection[known]
        weights = rows * variance
        total = weights @ rows.T + self.covariance[np.ix_(known, known)]
        sizes = np.sqrt(np.where(np.diag(total) > 0.0, np.diag(total), 1.0))
        difference = (self.values[known] - rows @ before) / sizes
        corrected: _Array = before + weights.T @ (np.linalg.lstsq(total / np.outer(sizes, sizes), difference)[0] / sizes)
        return corrected

    @property
    def offsets(self) -> _Array:
        """The identified torque offset of each joint, (n,), N m or N. They are zero if the identification did not include offsets.

        An offset that is grouped with another parameter cannot be distinguished from it; `base.grouping` shows the groups.
        """
        return self._of_joints.get("offset", np.zeros(self.base.arm.n))

    @property
    def _of_joints(self) -> dict[str, _Array]:
        """The identified parameters of the joints by kind, (n,) each."""
        kinds = ["armature"] * self.base.armature + ["damping", "friction"] * self.base.friction + ["offset"] * self.base.offset
        values = self.parameters[self.base.arm.parameters.size :].reshape(-1, self.base.arm.n)
        return dict(zip(kinds, values, strict=True))

    @property
    def unidentified(self) -> tuple[str, ...]:
        """The base parameters that the record does not determine."""
        return tuple(name for name, deviation in zip(self.base.grouping, self.deviations, strict=True) if not np.isfinite(deviation))

    def __str__(self) -> str:
        head = f"rank {self.rank} of {self.base.count}, condition {self.condition:.3g}, residuals " + ", ".join(
            f"{residual:.3g}" for residual in self.residuals
        )
        lines = [
            f"  {value: .6g} +- {deviation:.2g}  {name}"
            for value, deviation, name in zip(self.values, self.deviations, self.base.grouping, strict=True)
        ]
        return "\n".join([head, *lines])

    def __repr__(self) -> str:
        return f"<Identification: rank {self.rank} of {self.base.count}, condition {self.condition:.3g}>"


def _scale(pi: _Array) -> _Array:
    """Magnitudes of inertial parameters: `m`, `m r` and `m r^2` of each body, or the values of `planar_pr`."""
    if pi.size % 10:
        return np.abs(pi)
    mass, inertia = pi[::10], pi[4::10] + pi[6::10] + pi[9::10]
    radius = np.sqrt(np.divide(inertia, 2.0 * mass, out=np.zeros_like(mass), where=mass > 0.0).clip(0.0))
    scale: _Array = (mass[:, None] * radius[:, None] ** [0, 1, 1, 1, 2, 2, 2, 2, 2, 2]).ravel()
    return scale
