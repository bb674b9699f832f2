"""The program of a closed loop in readable form: what a step computes, operation by operation, down to machine code."""

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
    """One program of a closed loop at one stage, as `loop_program` gives it; `print(program)` lists it, `len(program)` counts its lines.

    Attributes:
        plant, law, method: names of the plant, the law and the method of the program.
        part: "step" is one whole step and "rates" the right-hand side, which a larger loop runs in every stage of a step. "law" is the law
            alone, for records and samples. "segment1", .. is what a larger loop computes between the stages. Implicit methods have "values"
            (the rates, and what their derivatives read) and the derivatives "along_plant" and "along_law".
        parts: all programs of this loop, with the number of their instructions.
        stage: "recorded" as the source computes it, "simplified", "lowered" to the instruction set, or "machine" with its registers.
        engine: how it runs here, "machine" or "portable".
        instruction_set, lanes: the instruction set, and how many numbers an instruction computes.
        code_bytes: length of the machine code; None on processors that armlet emits no code for.
        spilled: the number of values that move to memory because there are too few registers; None as above.
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
        """The lines of this stage, in order. Each name is written once; stage "machine" writes registers `r0`, .. and memory many times."""
        return self._listings[self.stage].instructions

    @property
    def outputs(self) -> dict[str, str]:
        """The outputs: the name of each output, and the line, input or number that is its value. A step overwrites its inputs."""
        return dict(self._listings[self.stage].outputs)

    @property
    def inputs(self) -> dict[str, float | None]:
        """The inputs: numbers of the set-up of this loop (parameters, gains, targets, limits), or None for inputs that change during a
        run."""
        used = self._used()
        return {name: value for (name, _), value in self._inputs if name in used}

    @property
    def operations(self) -> dict[str, int]:
        """How many lines there are of each kind, the most frequent first."""
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
        """The available stages. A program that the source can only compute simplified has no stage "recorded"."""
        return tuple(stage for stage in STAGES if stage in self._listings)

    def at(self, stage: str) -> LoopProgram:
        """Return the same program at another stage.

        Args:
            stage: "recorded", "simplified", "lowered" or "machine".

        Returns:
            The program at that stage.

        Raises:
            InputError: there is no such stage.
        """
        return replace(self, stage=choice("LoopProgram.at", "stage", stage, self.stages))

    def plot(self, fig: Figure | None = None) -> Axes:
        """Draw the data flow at this stage, from left to right by depth, with the longest chain in bold.

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

    It is `x_next = step(x, u, h)` for small loops under fixed steps, and the rates `x' = f(x, u)` for larger ones and for adaptive methods.
    The lines of every stage, evaluated in order, have the same bits (`fma` rounds once).

    Args:
        plant, law, method, sample_time, force, force_frame, tau_max, monitors: as for `simulate`. A monitored loop computes more.
        batch: the program of `simulate_batch`, which computes one run in every lane of a register; for fixed steps.
        part: one of the loop's programs, by its name in `LoopProgram.parts`; None: "step", or "rates" for a step in several parts.
        stage: "recorded", "simplified", "lowered" or "machine"; `LoopProgram.at` returns the others.

    Returns:
        The program. Names of its inputs: `q1, v1, theta1, theta_dot1, bristle1` are the state, and `estimate1` or `z1` that of the law.
        `q_d1, v_d1, a_d1` are the desired motion at the start of a step (`_mid` and `_end` in its middle and at its end). `x1_d1, xdot1_d1,
        xddot1_d1` are a desired motion of a task. `h` is the step, `kp1, kd1, ..` are gains. `m1, mx1, Ixx1, ..` are parameters of body 1
        in axes with z along its joint. An input without a name is `c17`.

    Raises:
        InputError: an argument is not valid, or the loop runs directly, without a program; the message has the reason.

    Source: docs/programs.md.

    >>> import armlet as al
    >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    >>> law = al.ComputedTorque(arm, al.Hold([1.0, 0.5]), kp=100.0, kd=20.0)
    >>> program = al.loop_program(al.RigidArm(arm), law, method="euler")
    >>> program.part, len(program) < len(program.at("recorded")), program.inputs["kp1"]
    ('step', True, 100.0)
    """
    choice("loop_program", "stage", stage, STAGES)
    keywords = {name: value for name, value in locals().items() if name not in ("plant", "law", "stage")}
    keywords |= {"t_end": 1.0, "record_every": 1}
    fields = _core.loop_program(plant, law, keywords)
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
