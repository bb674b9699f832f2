"""A recorded motion of an arm, with the operations that prepare it for identification."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..arguments import choice, finite, integer, number, positive, text
from ..border import bordered
from ..errors import InputError
from ..files import write_whole
from ..pickling import sealed
from .clock import examined
from .filters import interpolated, low_pass
from .report import LogReport

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["REFERENCES", "SERIES", "Log"]

Array = NDArray[np.float64]

#: The series of a log besides the positions, and the references by name.
SERIES = ("q", "v", "tau", "theta")
REFERENCES = ("q", "v", "a", "tau")
#: The largest number of samples that `resample` makes.
MOST = 100_000_000


@bordered
@sealed
class Log:
    """Samples of an arm's motion over time, as `read_log` returns them. All numbers have SI units.

    The arguments are attributes too. Series that were not recorded are None.

    Args:
        t: times, (K,), s. They increase.
        q: joint positions, (K, n), rad or m.
        v: joint velocities, (K, n), rad/s or m/s (keyword only).
        tau: joint torques or forces, (K, n), N m or N (keyword only).
        theta: motor positions of elastic joints, (K, n), rad or m (keyword only).
        references: desired values by name, (K, n) each: "q", "v", "a" and "tau" (keyword only).
        names: names of the joints; `joint1`, `joint2`, .. if None (keyword only).
        units: unit of each joint's position, "rad" or "m"; "rad" if None (keyword only).
        start: the value of the recording's clock at the first sample, s (keyword only).

    Attributes:
        report: what the file showed (`LogReport`).

    Raises:
        InputError: a shape is wrong, a number is not finite, or the times do not increase.

    Source: docs/logs.md.

    >>> import numpy as np
    >>> import armlet as al
    >>> t = np.linspace(0.0, 2.0, 201)
    >>> log = al.Log(t, np.sin(t)[:, None], names=["elbow"])
    >>> log
    <Log: 201 samples of 1 joint, 2 s: q>
    >>> log.cut(0.5, 1.0).resample(0.1).t.round(2)
    array([0.5, 0.6, 0.7, 0.8, 0.9, 1. ])
    """

    def __init__(
        self,
        t: ArrayLike,
        q: ArrayLike,
        *,
        v: ArrayLike | None = None,
        tau: ArrayLike | None = None,
        theta: ArrayLike | None = None,
        references: Mapping[str, ArrayLike] | None = None,
        names: list[str] | tuple[str, ...] | None = None,
        units: list[str] | tuple[str, ...] | None = None,
        start: float = 0.0,
    ) -> None:
        self.t: Array = finite("Log", "t", _core.numbers("Log", "t", t, ("K",))).copy()
        steps = np.diff(self.t)
        if not (steps > 0.0).all():
            k = int(np.argmin(steps > 0.0)) + 1
            raise InputError(
                f"Log: t does not increase: expected increasing times, got {self.t[k]} after {self.t[k - 1]} (first bad index {k})"
            )
        self.q: Array = self._series("q", q, ("K", "n"))
        self.v = None if v is None else self._series("v", v)
        self.tau = None if tau is None else self._series("tau", tau)
        self.theta = None if theta is None else self._series("theta", theta)
        given = {choice("Log", "references", name, REFERENCES): value for name, value in (references or {}).items()}
        self.references: dict[str, Array] = {name: self._series(f"references[{name!r}]", value) for name, value in given.items()}
        n = self.q.shape[1]
        self.names: tuple[str, ...] = tuple(f"joint{i + 1}" for i in range(n)) if names is None else tuple(names)
        self.units: tuple[str, ...] = ("rad",) * n if units is None else tuple(units)
        for name, stated in (("names", self.names), ("units", self.units)):
            if len(stated) != n:
                raise InputError(f"Log: {name} have the wrong size: expected {n}, got {len(stated)}")
        for name, unit in zip(self.names, self.units, strict=True):
            text("Log", "names", name)
            choice("Log", "units", unit, ("rad", "m"))
        if len(set(self.names)) < n:
            raise InputError(f"Log: names are not different: expected different names, got {list(self.names)}")
        self.start = number("Log", "start", start)
        self.report: LogReport = self._examined()

    def _series(self, name: str, value: ArrayLike, shape: tuple[int | str, ...] | None = None) -> Array:
        array = finite("Log", name, _core.numbers("Log", name, value, shape or self.q.shape)).copy()
        if len(array) != len(self.t):
            raise InputError(f"Log: {name} has the wrong length: expected {len(self.t)} samples, got {len(array)}")
        return array

    def _examined(self) -> LogReport:
        clock = examined(self.t, self.q, self.start)
        gaps = tuple((float(self.t[k]), round((self.t[k + 1] - self.t[k]) / clock.period) - 1) for k in clock.gaps)
        jumps = tuple((float(self.t[k]), float(self.t[k + 1] - self.t[k] - clock.period)) for k in clock.jumps)
        duration = float(self.t[-1] - self.t[0]) if len(self.t) else 0.0
        found = LogReport(len(self.t), self.names, duration, clock.period, clock.jitter, clock.uneven, clock.dropped, gaps, jumps)
        return replace(found, remarks=("the intervals are irregular: dropped samples are not counted",) * clock.irregular)

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.q.shape[1])

    def cut(self, t0: float, t1: float) -> Log:
        """Return the samples with `t0 <= t <= t1`. The times do not change.

        Args:
            t0, t1: start and end, s.

        Returns:
            The part of the log.

        Raises:
            InputError: no sample is between `t0` and `t1`.
        """
        low, high = number("Log.cut", "t0", t0), number("Log.cut", "t1", t1)
        inside = (self.t >= low) & (self.t <= high)
        if not inside.any():
            between = f"between {self.t[0]:g} s and {self.t[-1]:g} s" if len(self.t) else "in the log, which is empty"
            raise InputError(f"Log.cut: t0, t1 contain no sample: expected times {between}, got {low:g} and {high:g}")
        return self._changed(self.t[inside], lambda values: values[inside], f"cut({low:g}, {high:g})")

    def resample(self, dt: float) -> Log:
        """Interpolate linearly at the times `t[0] + k dt`. The error of a smooth signal is at most `a h^2 / 8`.

        Here `a` is the largest second derivative of the signal, and `h` the interval between its samples.

        Args:
            dt: interval of the new times, s, > 0.

        Returns:
            The log at the new times.

        Raises:
            InputError: `dt` is not positive, or the log would have too many samples.
        """
        step = positive("Log.resample", "dt", dt)
        # Rounding of the last time must not remove the last sample.
        count = np.floor((self.t[-1] - self.t[0]) / step * (1.0 + 1e-12) + 1e-9) + 1 if len(self.t) else 0
        if not count <= MOST:
            raise InputError(f"Log.resample: dt is too small: expected at most {MOST:,} samples, got {count:.3g}")
        times = self.t[:1] + step * np.arange(int(count))
        return self._changed(times, lambda values: interpolated(times, self.t, values), f"resample({step:g})")

    def filter(self, cutoff: float, *, order: int = 2) -> Log:
        """Filter all series without phase: a Butterworth low-pass filter that runs forwards and backwards.

        At the frequency `f` the gain is `1 / (1 + (tan(pi f T) / tan(pi cutoff T))^(2 order))`, with the interval `T` of the samples.
        At the cutoff it is 1/2. The first and the last sample do not change.

        Args:
            cutoff: frequency in Hz, below half of the sample rate.
            order: order of the Butterworth filter, 1 to 8 (keyword only).

        Returns:
            The filtered log.

        Raises:
            InputError: the times are uneven, or the cutoff is out of range.

        Source: [OppenheimSchafer2010], section 7.2.
        """
        frequency, power = positive("Log.filter", "cutoff", cutoff), integer("Log.filter", "order", order, 1, 8)
        clock = examined(self.t, self.q, self.start)
        if clock.uneven or clock.irregular or len(clock.gaps) or len(clock.jumps):
            raise InputError("Log.filter: t is uneven: expected equal intervals: call resample first")
        if len(self.t) > 1 and not frequency * clock.period < 0.5:
            raise InputError(f"Log.filter: cutoff is too high: expected less than {0.5 / clock.period:g} Hz, got {frequency:g}")
        return self._changed(
            self.t, lambda values: low_pass(values, clock.period, frequency, power), f"filter({frequency:g} Hz, order {power})"
        )

    def _changed(self, t: Array, change: Callable[[Array], Array], step: str) -> Log:
        series: dict[str, Any] = {name: None if (values := getattr(self, name)) is None else change(values) for name in SERIES}
        references = {name: change(values) for name, values in self.references.items()}
        made = Log(t, series.pop("q"), **series, references=references, names=self.names, units=self.units, start=self.start)
        found = made.report
        made.report = replace(found, remarks=self.report.remarks, steps=(*self.report.steps, step), wraps=self.report.wraps)
        return made

    def plot(self, fig: Figure | None = None) -> NDArray[Any]:
        """Draw positions, velocities and torques over time, with the references dashed, and return the axes.

        Args:
            fig: a figure of matplotlib; None for a new one.

        Returns:
            The axes, as an array.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from ..figures.log import plot

        return plot(self, fig)

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the log as CSV with units in the header. `read_log` reads the same numbers from the file.

        Args:
            path: the file. It is complete or absent.
        """
        headers, columns = ["t [s]"], [self.t[:, None]]
        tables = {name: getattr(self, name) for name in SERIES} | {f"{name}_d": values for name, values in self.references.items()}
        for name, values in tables.items():
            if values is not None:
                headers += [f"{joint}/{_WORDS[name]} [{_unit(name, unit)}]" for joint, unit in zip(self.names, self.units, strict=True)]
                columns.append(values)
        quoted = [f'"{each}"' if "," in each else each for each in headers]
        rows = np.concatenate(columns, axis=1)

        def write(file: Any) -> None:
            file.write((",".join(quoted) + "\n").encode())
            for part in np.array_split(rows, max(1, len(rows) // 10_000)):
                file.write("".join(",".join(map(repr, row)) + "\n" for row in part.tolist()).encode())

        write_whole(path, write)

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        present = [name for name in SERIES if getattr(self, name) is not None] + [f"{name}_d" for name in self.references]
        return f"<Log: {len(self.t)} samples of {self.n} joint{'s' * (self.n > 1)}, {self.report.duration:.4g} s: {', '.join(present)}>"


_WORDS = {"q": "position", "v": "velocity", "tau": "torque", "theta": "motor_position"}
_WORDS |= {"q_d": "desired_position", "v_d": "desired_velocity", "a_d": "desired_acceleration", "tau_d": "desired_torque"}


def _unit(name: str, unit: str) -> str:
    """The unit of the series `name` of a joint whose position has the unit `unit`."""
    letter = name.removesuffix("_d")
    if letter == "tau":
        return "N m" if unit == "rad" else "N"
    return unit + {"q": "", "theta": "", "v": "/s", "a": "/s^2"}[letter]
