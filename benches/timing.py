"""Times of cases, and their ratios to the time of a yardstick case: medians over rounds. Every round runs every case once.

So noise affects all cases alike. Shared by all benchmarks: interleaved rounds, pinning to cores, two clocks, a description of the machine,
tables, and the file of results.

Each call is timed by the wall clock and by the processor time of the whole process. On a quiet machine both times agree for one thread.
On a busy machine the wall time includes other programs. So ratios of single-thread cases use processor times. If several threads take
part, both times of the ratio are wall times, and the ratio is conclusive only on a quiet machine.
"""

from __future__ import annotations

import gc
import json
import os
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

Peer = TypeVar("Peer")


@dataclass
class Case:
    """One computation to time.

    `run` is called once per round. If `timed`, it returns its wall and processor seconds, measured by itself. `per` is the number of units
    (steps, calls) of one call. `scale` converts seconds per unit to `unit`. `clock` is the clock of its figures and ratios, "wall" or
    "processor". `rounds` is the number of rounds; None: every round, or at most 5 if one call takes 0.15 s or longer.
    """

    group: str
    name: str
    run: Callable[[], Any]
    per: float
    unit: str = "ns"
    scale: float = 1e9
    threads: int = 1
    clock: str = ""
    timed: bool = False
    rounds: int | None = None
    against: str | None = None
    wall: dict[int, float] = field(default_factory=dict)
    processor: dict[int, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.clock = self.clock or ("processor" if self.threads == 1 else "wall")

    def seconds(self, clock: str = "") -> dict[int, float]:
        """Measured seconds of each round, by the clock `clock`, or by the case's clock if that is empty."""
        return self.wall if (clock or self.clock) == "wall" else self.processor

    def figure(self, seconds: float) -> float:
        return seconds / self.per * self.scale

    @property
    def median(self) -> float:
        return self.figure(statistics.median(self.seconds().values()))


def clocked(run: Callable[[], Any]) -> tuple[float, float]:
    """Wall and processor seconds of one call."""
    wall, processor = time.perf_counter(), time.process_time()
    run()
    return time.perf_counter() - wall, time.process_time() - processor


def if_there(name: str, make: Callable[[], Peer], say: Callable[[str], None]) -> Peer | None:
    """The peer that the function `make` builds. If an import or a compilation fails, print a line and return None."""
    try:
        return make()
    except ImportError as missing:
        say(f"skipped: {name}: {missing}")
        return None


def cores() -> list[int]:
    return sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else list(range(os.cpu_count() or 1))


def pin(allowed: list[int]) -> None:
    """Bind every thread of this process, including those of thread pools, to these cores."""
    if not hasattr(os, "sched_setaffinity"):
        return
    for thread in os.listdir("/proc/self/task"):
        try:
            os.sched_setaffinity(int(thread), allowed)
        except ProcessLookupError:  # the thread has ended
            continue


def measure(cases: list[Case], rounds: int, core: int, say: Callable[[str], None]) -> None:
    """Time every case in every round: single-thread cases on `core`, the others on all cores. Slow cases run only in some rounds."""
    every = cores()
    for case in cases:  # warm up (compile, build pools, load pages), and find the slow cases
        pin([core] if case.threads == 1 else every)
        wall, _ = clocked(case.run)
        if case.rounds is None:
            case.rounds = rounds if wall < 0.15 else min(rounds, 5)
    gc.disable()
    for k in range(rounds):
        say(f"round {k + 1}/{rounds}")
        for case in cases:
            assert case.rounds is not None
            if k % max(1, rounds // case.rounds) or len(case.wall) >= case.rounds:
                continue
            pin([core] if case.threads == 1 else every)
            if case.threads > 1:
                # Untimed warm-up: after threads were bound to one core, the scheduler takes tens of milliseconds to distribute them.
                warm = time.perf_counter()
                while time.perf_counter() - warm < 0.1:
                    case.run()
            case.wall[k], case.processor[k] = case.run() if case.timed else clocked(case.run)
    gc.enable()
    pin(every)


def ratio(case: Case, yardstick: Case) -> float:
    """Median over rounds of the time of `case` divided by the time of `yardstick` in the same round, both by one clock."""
    clock = "wall" if "wall" in (case.clock, yardstick.clock) else "processor"
    ours, theirs = case.seconds(clock), yardstick.seconds(clock)
    return statistics.median((ours[k] / case.per) / (theirs[k] / yardstick.per) for k in ours.keys() & theirs.keys())


def machine() -> dict[str, Any]:
    """Processor model and number of cores, without any name of the machine."""
    model, flags = "unknown processor", set()
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            key, _, value = line.partition(":")
            if key.strip() == "model name":
                model = value.strip()
            elif key.strip() == "flags":
                flags = set(value.split())
    except OSError:
        pass
    widest = next((name for flag, name in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags), "no AVX2")
    return {"cpu": model, "cores": os.cpu_count(), "simd": widest}


def busy() -> float:
    """The share of all cores' time that other programs use during one second; 0 if the system does not report it."""

    def ticks() -> list[int]:
        return [int(field) for field in Path("/proc/stat").read_text().splitlines()[0].split()[1:9]]

    try:
        before = ticks()
        time.sleep(1.0)
        spent = [b - a for a, b in zip(before, ticks(), strict=True)]
    except OSError:
        return 0.0
    return 1.0 - (spent[3] + spent[4]) / max(1, sum(spent))  # idle, and idle while waiting for a disk


def digits(value: float) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"


def rows(cases: list[Case]) -> list[tuple[str, ...]]:
    """Rows `(group, case, wall, fastest, processor, yardstick, ratio)` as text. The yardstick of a case is named by `against`."""
    by_name = {case.name: case for case in cases}
    lines = []
    for case in cases:
        yard = by_name.get(case.against or "")
        compared = (yard.name, f"{ratio(case, yard):.2f}") if yard is not None else ("", "")
        times = (statistics.median(case.wall.values()), min(case.wall.values()), statistics.median(case.processor.values()))
        lines.append((case.group, case.name, *(digits(case.figure(each)) for each in times), *compared))
    return lines


def markdown(lines: list[tuple[str, ...]]) -> str:
    """The rows in Markdown, one table per group."""
    text, group = [], None
    for line in lines:
        if line[0] != group:
            group = line[0]
            text += ["", f"**{group}**", "", "| case | wall | fastest | processor | ratio | to |", "|---|---:|---:|---:|---:|---|"]
        text.append(f"| {line[1]} | {line[2]} | {line[3]} | {line[4]} | {line[6]} | {line[5]} |")
    return "\n".join(text).strip()


def plain(lines: list[tuple[str, ...]]) -> str:
    """The rows as text for a terminal."""
    width = max(len(line[1]) for line in lines)
    text, group = [], None
    for line in lines:
        if line[0] != group:
            group = line[0]
            text += ["", group, f"  {'':{width}}  {'wall':>9} {'fastest':>9} {'processor':>9}   ratio"]
        compared = f"   {line[6]:>5} of {line[5]}" if line[5] else ""
        text.append(f"  {line[1]:{width}}  {line[2]:>9} {line[3]:>9} {line[4]:>9}{compared}")
    return "\n".join(text)


def save(path: Path, cases: list[Case], extra: dict[str, Any]) -> None:
    """Write all measured times, so that other statistics can be computed later."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fields = ("group", "name", "unit", "per", "scale", "threads", "clock", "against")
    clocks = [{clock: list(getattr(case, clock).values()) for clock in ("wall", "processor")} for case in cases]
    table = [{name: getattr(case, name) for name in fields} | times for case, times in zip(cases, clocks, strict=True)]
    path.write_text(json.dumps(extra | {"cases": table}, indent=1) + "\n")
