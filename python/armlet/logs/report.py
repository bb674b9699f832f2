"""The report of a log: what its times, angles and columns show."""

from __future__ import annotations

from dataclasses import dataclass

from ..pickling import sealed

__all__ = ["LogReport"]


@sealed
@dataclass(frozen=True)
class LogReport:
    """What `read_log` found in a log. `print(log.report)` shows it in words.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> run = al.simulate(al.RigidArm(arm), al.PDGravity(arm, [0.1, 0.2], 50.0, 5.0), [0.0, 0.0], t_end=1.0, dt=1e-3)
    >>> print(al.read_log(run).report)
    1001 samples of 2 joints (joint1, joint2), 1 s
    """

    #: Number of samples, and names of the joints.
    samples: int
    joints: tuple[str, ...]
    #: Duration from the first to the last sample, s.
    duration: float
    #: Median interval between samples, and root mean square deviation from it, s. The deviation is without gaps.
    period: float = float("nan")
    jitter: float = 0.0
    #: Whether an interval without a gap deviates from the period by more than 0.1 %.
    uneven: bool = False
    #: Number of missing samples. It is zero if the intervals are too irregular to count them.
    dropped: int = 0
    #: Times before each gap, s, and the number of samples that are missing there.
    gaps: tuple[tuple[float, int], ...] = ()
    #: Times before each jump of the clock, s, and the change of the interval by the jump, s.
    clock_jumps: tuple[tuple[float, float], ...] = ()
    #: Whether the times after the clock jumps were corrected.
    repaired: bool = False
    #: Number of samples that were removed because they repeat the sample before.
    repeated: int = 0
    #: Number of samples that were removed because a number was missing.
    incomplete: int = 0
    #: Number of wraps of each joint's angle that were undone, (n,); empty without positions.
    wraps: tuple[int, ...] = ()
    #: Remarks about units and columns.
    remarks: tuple[str, ...] = ()
    #: The steps of processing after the file was read, such as `filter(20.0)`.
    steps: tuple[str, ...] = ()

    def __str__(self) -> str:
        names = ", ".join(self.joints[:12]) + (", .." if len(self.joints) > 12 else "")
        lines = [f"{self.samples} samples of {len(self.joints)} joint{'s' * (len(self.joints) > 1)} ({names}), {self.duration:.6g} s"]
        if self.uneven:
            lines.append(f"uneven intervals: median {self.period:.6g} s, deviation {self.jitter:.3g} s")
        if self.dropped:
            first, count = self.gaps[0]
            lines.append(f"dropped samples: {self.dropped} in {len(self.gaps)} gaps, the first ({count}) after {first:.6g} s")
        for t, change in self.clock_jumps[:5]:
            lines.append(f"clock jump of {change:.6g} s after {t:.6g} s{', corrected' if self.repaired else ''}")
        if len(self.clock_jumps) > 5:
            lines.append(f"clock jumps: {len(self.clock_jumps)}")
        if self.repeated:
            lines.append(f"repeated samples removed: {self.repeated}")
        if self.incomplete:
            lines.append(f"incomplete samples removed: {self.incomplete}")
        wrapped = [f"{joint} ({count})" for joint, count in zip(self.joints, self.wraps, strict=False) if count]
        if wrapped:
            lines.append(f"wrapped angles continued: {', '.join(wrapped)}")
        lines += self.remarks
        lines += [f"then: {step}" for step in self.steps]
        return "\n".join(lines)
