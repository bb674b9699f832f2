"""The hierarchy of errors. Invalid arguments and broken models raise errors. The result of a run is a status.

::

    ArmletError
    ├── InputError (ValueError)       an argument is not valid
    │   └── ModelError                a robot model is not well formed; .file .line
    ├── SolveError (RuntimeError)     a run or a solver ended without its result; .status .t .partial
    ├── FormatError (ValueError)      stored data is damaged or in another format
    └── InternalError (RuntimeError)  a bug of armlet, see armlet/border.py

Messages of InputError have the form ``function: argument problem: expected .., got .. (first bad index ..)``. Some messages omit the last
parts.
"""

from __future__ import annotations

from typing import Any

from .status import Status

__all__ = ["ArmletError", "FormatError", "InputError", "InternalError", "ModelError", "SolveError"]


class ArmletError(Exception):
    """The base class of all errors that armlet raises."""


class InputError(ArmletError, ValueError):
    """An argument is not valid: its type, shape, sign or range is wrong, or it is not finite.

    The message names the argument and the problem. If the Rust core raises the error, the attributes contain parts of the message.

    Attributes:
        argument: the name of the argument; None if only the message contains it.
        problem: the problem of the argument, without name and index; None if only the message contains it.
        index: the first bad index, one number per axis; empty if there is no index.
        available: the valid names, if a name is unknown.
    """

    argument: str | None = None
    problem: str | None = None
    index: tuple[int, ...] = ()
    available: tuple[str, ...] = ()


class ModelError(InputError):
    """A robot model is not well formed; `file` and `line` name the place of the fault.

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
        status: the `armlet.Status` with which it ended, with advice; None if no status applies.
        t: the time (s) or the iteration at which it ended; None if there is none.
        partial: the partial result: a `Run` up to `t`, or the last iterate; None if there is none.
    """

    def __init__(self, message: str, status: Status | int | None = None, t: float | None = None, partial: Any = None) -> None:
        super().__init__(message)
        self.status = None if status is None else Status(status)
        self.t = t
        self.partial = partial

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.status, self.t, self.partial)


class FormatError(ArmletError, ValueError):
    """Stored data is damaged, truncated, of a newer version, or not in the expected format."""


class InternalError(ArmletError, RuntimeError):
    """An unexpected error inside armlet, which is a bug of armlet. Please report it with the message."""
