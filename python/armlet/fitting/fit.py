"""The result of `fit_log`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..border import bordered
from ..logs.log import Log
from ..pickling import sealed
from .refuted import Refuted, refuted_by, refuted_of
from .sensors import Sensors

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .._core import Arm
    from .evidence import Evidence

__all__ = ["LogFit"]

_Array = NDArray[np.float64]

#: Two parameters are strongly correlated above this absolute correlation.
STRONG = 0.95
#: A joint hardly moves if its range is below this fraction of the largest range.
STILL = 0.01


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class LogFit:
    """The parameters of an arm or of a plant that fit a log, with their accuracy. `print(fit)` shows them."""

    #: Names of the b fitted parameters: sums of parameters of bodies, and parameters of joints.
    names: tuple[str, ...]
    #: Values and standard deviations, (b,), in SI units. The deviation of a parameter that the log does not determine is infinite.
    values: _Array
    deviations: _Array
    #: Covariance of the values, (b, b).
    covariance: _Array
    #: Number of combinations of parameters that the log determines, and condition number of the columns with length one.
    rank: int
    condition: float
    #: Root mean square of the torque that the model does not explain, (n,), N m or N.
    residuals: _Array
    #: The model with the fitted parameters: an arm, a plant, a pair `(plant, law)` or a `Scenario`, as `fit_log` received it.
    model: Any
    #: The arm of the model, with the fitted parameters of bodies, and of rotors and friction unless the joints are elastic.
    arm: Arm
    #: The kinds of parameters that were fitted, and the names of the joints.
    kinds: tuple[str, ...]
    joints: tuple[str, ...]
    #: Times of the K filtered samples, s, their torques, and the torques that the model does not explain, (K, n), N m or N. For a plant,
    #: the samples are means over blocks, and the last torques are computed from the errors of the predictions.
    t: _Array
    measured: _Array
    residual: _Array
    #: Range of each joint's positions, (n,), rad or m, and the cutoff of the filter, Hz.
    ranges: _Array
    cutoff: float
    #: The log, the speed of Stribeck friction, rad/s or m/s, and the given or fitted delay of the torques, s.
    log: Log
    stribeck_speed: float
    delay: float
    #: With `consistent=True`: the fit before the projection, which has the inertial parameters.
    before: LogFit | None = None
    #: For a plant: the samples of the tests of assumptions.
    evidence: Evidence | None = None

    def _of_joints(self, kind: str) -> _Array:
        found = dict(zip(self.names, self.values, strict=True))
        return np.array([found.get(f"{kind}[{joint}]", 0.0) for joint in self.arm.joint_names])

    @property
    def offsets(self) -> _Array:
        """Fitted torque offset of each joint, (n,), N m or N; zeros if they were not fitted, or are grouped with other parameters."""
        return self._of_joints("offset")

    @property
    def stribeck(self) -> _Array:
        """Fitted Stribeck friction of each joint, (n,), N m or N; zeros if it was not fitted."""
        return self._of_joints("stribeck")

    @property
    def torque_constants(self) -> _Array:
        """Fitted factor of the recorded torque of each joint, (n,); ones if they were not fitted."""
        return self._of_joints("torque_constant") if "torque_constants" in self.kinds else np.ones(len(self.joints))

    @property
    def encoder_offsets(self) -> _Array:
        """Fitted recorded minus true position of each joint, (n,), rad or m; zeros if they were not fitted."""
        return self._of_joints("encoder_offset")

    @cached_property
    def _verdict(self) -> tuple[tuple[Refuted, ...], tuple[str, ...]]:
        if self.before is not None:
            return self.before._verdict
        if self.evidence is not None:
            return refuted_by(self.evidence, self.log, self.kinds, self.stribeck_speed, self.delay, self.residual)
        sensors = Sensors.start(self.kinds, len(self.joints), self.delay)
        sensors = replace(sensors, constants=self.torque_constants, offsets=self.encoder_offsets)
        return refuted_of(self.arm, self.log, self.kinds, self.stribeck_speed, self.cutoff, sensors, self.residual)

    @property
    def refuted(self) -> tuple[Refuted, ...]:
        """The assumptions that the log refutes at the family level 5 %, as `Refuted`; empty if there are none.

        The first entry explains most of the residual. Each later entry states what the entries before do not explain. With
        `consistent=True`, the tests apply to the fit before the projection. docs/fit.md has the list of assumptions.
        """
        return self._verdict[0]

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """In words: the parameters that the log does not determine, and the joints that hardly move.

        It has the assumptions too that `refuted` cannot test, because a fault has the same torque as fitted parameters.
        """
        hidden = [name for name, deviation in zip(self.names, self.deviations, strict=True) if not np.isfinite(deviation)]
        lines = [f"not identifiable from this log: {name}" for name in hidden]
        if any(name.startswith("torque_constant[") for name in hidden):
            lines.append("torque constants and other parameters have a common factor: fit torque_constants without inertia")
        still = [joint for joint, moved in zip(self.joints, self.ranges, strict=True) if moved <= STILL * self.ranges.max(initial=0.0)]
        moves = [f"joint {joint!r} hardly moves: move it while the other joints move" for joint in still] if hidden else []
        return (*lines, *self._verdict[1], *moves)

    @property
    def correlated(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of parameters whose estimates have an absolute correlation above 0.95, with the correlation, the largest first."""
        scale = np.sqrt(np.diag(self.covariance))
        scale = np.where(scale > 0.0, scale, np.inf)
        ratio = self.covariance / np.outer(scale, scale)
        pairs = [(i, k) for i, k in np.argwhere(np.abs(np.triu(ratio, 1)) > STRONG).tolist() if np.isfinite(self.deviations[[i, k]]).all()]
        pairs.sort(key=lambda pair: -abs(ratio[pair]))
        return tuple((self.names[i], self.names[k], float(ratio[i, k])) for i, k in pairs)

    def plot(self, fig: Figure | None = None) -> NDArray[Any]:
        """Draw the measured torque, the torque of the model and the residual of each joint, and return the axes.

        Args:
            fig: a figure of matplotlib; None for a new one.

        Returns:
            The axes, as an array.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from ..figures.log import plot_fit

        return plot_fit(self, fig)

    def report(self, path: str | PathLike[str], *, title: str | None = None) -> None:
        """Write a report as one HTML file without network: refuted assumptions, a figure of each joint, parameters, versions.

        Without matplotlib (extra `plot`) the report has a sentence in place of the figure.

        Args:
            path: path of the file. The file is complete or absent.
            title: heading of the report; the number of joints if None (keyword only).

        Raises:
            InputError: an argument is not valid; the message names it.
            OSError: the file cannot be written.
        """
        from ..reports.fits import write_fit

        write_fit(self, path, title)

    def __str__(self) -> str:
        head = f"rank {self.rank} of {len(self.names)}, condition {self.condition:.3g}, residuals "
        lines = [head + ", ".join(f"{residual:.3g}" for residual in self.residuals)]
        rows = zip(self.values, self.deviations, self.names, strict=True)
        lines += [f"  {value: .6g} +- {deviation:.2g}  {name}" for value, deviation, name in rows]
        lines += [f"refuted: {each}" for each in self.refuted]
        lines += self.unidentifiable
        lines += [f"correlated ({ratio:.3f}): {first} and {second}" for first, second, ratio in self.correlated[:5]]
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<LogFit: rank {self.rank} of {len(self.names)}, condition {self.condition:.3g}>"
