"""The program of a closed loop as a readable list of operations, from the recorded formulas to the machine code.

A *program* is the straight-line code that computes one step, or one part of a step, of the loop. A *line* is one operation of the program.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

from numpy.typing import ArrayLike

from .. import _core
from ..arguments import choice
from ..border import border, bordered
from ..pickling import sealed
from .instructions import Instruction, Listing
from .options import ProgramOptions
from .sampling import Sampling

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Instruction", "LoopProgram", "loop_program"]

STAGES = ("recorded", "simplified", "lowered", "machine")
Inputs: TypeAlias = tuple[tuple[tuple[str, str], float | None], ...]


@bordered
@sealed
@dataclass(frozen=True, eq=False, repr=False)
class LoopProgram:
    """One program of a closed loop at one stage, from `loop_program`. `print(program)` lists it, and `len(program)` is its number of lines.

    Attributes:
        plant, law, method: names of the plant, the law and the method of the program.
        part: "step" computes one whole step. "rates" computes the right-hand side, which a larger loop evaluates in every stage of a step.
            "law" computes only the law, for records and samples. "segment1", .. are the parts of a larger loop between two stages.
            Implicit methods have "values" (the rates and the inputs of their derivatives), "along_plant" and "along_law" (the derivatives).
        parts: names of all programs of this loop, with the number of lines of each. The programs that find changes of contacts and of
            sticking joints are not listed.
        stage: "recorded" has the operations of the source code. "simplified" is optimised, "lowered" is translated to the instruction set,
            and "machine" has registers.
        engine: the engine that runs the program on this processor, "machine" or "interpreter".
        instruction_set, lanes: the instruction set, and the number of floating-point numbers that one instruction computes.
        code_bytes: length of the machine code, bytes; None on processors for which armlet has no machine code.
        spilled: number of values that are stored in memory because the processor has too few registers; None if `code_bytes` is None.
    """

    plant: str
    law: str
    method: str
    part: str
    parts: dict[str, int]
    stage: str
    engine: str
    instruction_set: str
    lanes: int
    code_bytes: int | None
    spilled: int | None
    _inputs: Inputs
    _listings: dict[str, Listing]

    @property
    def instructions(self) -> tuple[Instruction, ...]:
        """The lines of this stage, in order. Each name is assigned once. The stage "machine" reuses registers and memory."""
        return self._listings[self.stage].instructions

    @property
    def outputs(self) -> dict[str, str]:
        """The line, input or number that is the value of each output, by name.

        After a step, its outputs are the new values of the inputs that contain the state.
        """
        return dict(self._listings[self.stage].outputs)

    @property
    def inputs(self) -> dict[str, float | None]:
        """The inputs by name. A constant of this loop (a parameter, gain, target or limit) has its value, and an input that changes during
        a run has None."""
        used = self._used()
        return {name: value for (name, _), value in self._inputs if name in used}

    @property
    def operations(self) -> dict[str, int]:
        """The number of lines of each kind of operation, the most frequent kind first."""
        return dict(Counter(line.kind for line in self.instructions).most_common())

    @property
    def critical_path(self) -> int:
        """The number of lines in the longest chain of lines that depend on each other."""
        depth: dict[str, int] = {}
        for line in self.instructions:
            depth[line.name] = 1 + max((depth.get(operand, 0) for operand in line.operands), default=0)
        return max((depth.get(value, 0) for value in self.outputs.values()), default=0)

    @property
    def stages(self) -> tuple[str, ...]:
        """The names of the available stages. Some programs are recorded in simplified form only, and have no stage "recorded"."""
        return tuple(stage for stage in STAGES if stage in self._listings)

    def at(self, stage: str) -> LoopProgram:
        """Return the same program at another stage.

        Args:
            stage: "recorded", "simplified", "lowered" or "machine".

        Returns:
            The program at the other stage.

        Raises:
            InputError: the program has no such stage.
        """
        return replace(self, stage=choice("LoopProgram.at", "stage", stage, self.stages))

    def plot(self, fig: Figure | None = None) -> Axes:
        """Draw the data flow of the program, from left to right by depth, with the longest chain of dependent lines in bold.

        Args:
            fig: a matplotlib figure for the drawing; None makes one with pyplot.

        Returns:
            The axes.

        Raises:
            InputError: the program has more than 300 lines, too many for a figure.
            ImportError: matplotlib is not installed.
        """
        from ..figures.program import plot

        title = f"{self.plant} under {self.law}: {self.part}, {self.stage}, {len(self)} lines"
        return plot(self._listings[self.stage], self.stage, title, fig)

    def __len__(self) -> int:
        return len(self.instructions)

    def __repr__(self) -> str:
        return f"LoopProgram({self.plant}, {self.law}, {self.method}, part={self.part!r}, stage={self.stage!r}, {len(self)} lines)"

    def __str__(self) -> str:
        return "\n".join([*self._head(), "", *(f"  {line}" for line in self.instructions), *self._tail()])

    def _used(self) -> set[str]:
        names = {operand for line in self.instructions for operand in line.operands}
        return names | {value for output, value in self.outputs.items() if value != output or self.stage != "machine"}

    def _head(self) -> list[str]:
        what = {"step": "One step", "rates": "The rates of one stage", "law": "The law alone"}.get(self.part, f"Part {self.part}")
        together = "1 run" if self.lanes == 1 else f"{self.lanes} lanes"
        size = "" if self.code_bytes is None else f", {self.code_bytes} bytes, {self.spilled} values spilled"
        used = self._used()
        kinds = Counter(kind for (name, kind), _ in self._inputs if name in used)
        stages = [self.at(stage) for stage in self.stages]
        titles = ["stages", *("" for _ in stages[1:])]
        sizes = [
            f"  {title:11} {stage.stage:11} {len(stage):6} lines, {stage.critical_path:4} in the longest chain"
            for title, stage in zip(titles, stages, strict=True)
        ]
        return [
            f"{what} of {self.plant} under {self.law} by {self.method}",
            f"  engine      {self.engine}: {self.instruction_set}, {together}{size}",
            f"  parts       {_counts(self.parts)}",
            *sizes,
            f"  inputs      {sum(kinds.values())}: {_counts(kinds)}",
            f"  outputs     {len(self.outputs)}",
            f"  {self.stage:11} {_counts(self.operations)}",
        ]

    def _tail(self) -> list[str]:
        return [] if self.stage == "machine" else [f"  {name} <- {value}" for name, value in self.outputs.items()]


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())


@border
def loop_program(
    plant: _core.Plant,
    law: _core.Law | Callable[..., ArrayLike],
    *,
    method: str = "rk4",
    sample_time: float | Sampling | None = None,
    force: ArrayLike | Sequence[tuple[float, ArrayLike]] | Callable[[float], ArrayLike] | None = None,
    force_frame: str | None = None,
    tau_max: ArrayLike | None = None,
    monitors: bool = False,
    batch: bool = False,
    part: str | None = None,
    stage: str = "simplified",
) -> LoopProgram:
    """Return the program that `simulate` runs for the loop of `plant` and `law`.

    The program is `x_next = step(x, u, h)` for small loops with a fixed-step method. It is the rates `x_dot = f(x, u)` for larger loops,
    for adaptive methods and for stick-slip friction. Here `x` is the state, `u` the other inputs, such as the desired motion and the gains,
    and `h` the step. The lines of every stage, evaluated in order, have the same results to the bit (`fma` rounds once).

    Args:
        plant, law, method, sample_time, force, force_frame, tau_max: as for `simulate`.
        monitors: as for `simulate`. The program of a monitored loop has more lines.
        batch: True returns the program of `simulate_batch`, which computes one run in every lane of a register. It requires a fixed-step
            method, and a plant without stick-slip friction.
        part: name of one program of the loop, from `LoopProgram.parts`. None means "step", or "rates" if the step has several parts.
        stage: "recorded", "simplified", "lowered" or "machine". `LoopProgram.at` returns the other stages.

    Returns:
        The program. Names of its inputs: `q1, v1, theta1, theta_dot1, bristle1` are the state of the plant. `estimate1` or `z1` is the
        state of the law. `q_d1, v_d1, a_d1` are the desired motion at the start of a step, with the suffix `_mid` in its middle and `_end`
        at its end. `x1_d1, xdot1_d1, xddot1_d1` are the desired motion of task 1. `h` is the step, s. `kp1, kd1, ..` are gains. `m1, mx1,
        Ixx1, ..` are the inertial parameters of body 1, in axes with z along its joint. `contact1_pushes, contact1_inside` (0 or 1) are the
        mode of the first contact. With stick-slip friction, `side1` (0, 1 or -1) is the mode of joint 1. An input without a name is
        numbered, such as `c17`.

    Raises:
        InputError: an argument is not valid, or the law is not recorded; the message states the reason.

    Source: docs/programs.md.

    >>> import armlet as al
    >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    >>> law = al.ComputedTorque(arm, al.Hold([1.0, 0.5]), kp=100.0, kd=20.0)
    >>> program = al.loop_program(al.RigidArm(arm), law, method="euler")
    >>> program.part, len(program) < len(program.at("recorded")), program.inputs["kp1"]
    ('step', True, 100.0)
    """
    choice("loop_program", "stage", stage, STAGES)
    options = ProgramOptions(
        method=method, sample_time=sample_time, force=force, force_frame=force_frame, tau_max=tau_max, monitors=monitors, batch=batch,
        part=part, t_end=1.0, record_every=1,
    )  # fmt: skip
    fields = _core.loop_program(plant, law, options)
    listings = {
        name: Listing(tuple(Instruction(*line) for line in lines), tuple(outputs)) for name, (lines, outputs) in fields["stages"].items()
    }
    program = LoopProgram(
        plant=type(plant).__name__,
        law=type(law).__name__,
        method=method,
        part=fields["part"],
        parts=fields["parts"],
        stage="simplified",
        engine=fields["engine"],
        instruction_set=fields["set"],
        lanes=fields["lanes"],
        code_bytes=fields["code_bytes"],
        spilled=fields["spilled"],
        _inputs=tuple(((name, kind), value) for name, kind, value in fields["inputs"]),
        _listings=listings,
    )
    return program.at(stage)
