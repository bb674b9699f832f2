"""The tree of errors. Misuse and broken models are errors; the outcome of a run is a status.

::

    ArmletError
    ├── InputError (ValueError)       an argument is not valid
    │   └── ModelError                a robot model is not well formed; .file .line
    ├── SolveError (RuntimeError)     a run or a solver ended without its result; .status .t .partial
    ├── FormatError (ValueError)      stored data is not in the format it claims
    └── InternalError (RuntimeError)  a fault of armlet itself, caught at the border

Every message reads ``function: argument what is wrong: expected .., got .. (first bad index ..)``.
"""

from __future__ import annotations

from typing import Any

from .status import Status

__all__ = ["ArmletError", "FormatError", "InputError", "InternalError", "ModelError", "SolveError"]


class ArmletError(Exception):
    """The root of every error that armlet raises on purpose."""


class InputError(ArmletError, ValueError):
    """An argument is not valid: its type, shape, sign or range is wrong, or it is not finite.

    The message is complete. An error of the core also has its parts as attributes.

    Attributes:
        argument: the name of the argument; None if only the message has it.
        problem: what is wrong with it, without its name and its index; None if only the message has it.
        index: the first bad index, one number per axis; empty where there is none.
        available: the valid names, if a name is unknown.
    """

    argument: str | None = None
    problem: str | None = None
    index: tuple[int, ...] = ()
    available: tuple[str, ...] = ()


class ModelError(InputError):
    """A robot model is not well formed.

    Attributes:
        file: the file, or ``"<string>"`` for a model given as text; None for a model built in code.
        line: the 1-based line of the fault; None if the line is unknown.
    """

    def __init__(self, message: str, file: str | None = None, line: int | None = None) -> None:
        super().__init__(message)
        self.file = file
        self.line = line

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.file, self.line)


class SolveError(ArmletError, RuntimeError):
    """A run or a solver ended without a result.

    Attributes:
        status: how it ended, with advice (`armlet.Status`); None where no status applies.
        t: the time (s) or the iteration at which it ended; None where none applies.
        partial: the partial result: a `Run` up to `t`, or the last iterate; None without one.
    """

    def __init__(self, message: str, status: Status | int | None = None, t: float | None = None, partial: Any = None) -> None:
        super().__init__(message)
        self.status = None if status is None else Status(status)
        self.t = t
        self.partial = partial

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.status, self.t, self.partial)


class FormatError(ArmletError, ValueError):
    """Stored data is not in the format it claims: damaged, cut short, or of a newer version."""


class InternalError(ArmletError, RuntimeError):
    """A fault of armlet itself, caught at the border. Please report it with the message."""
