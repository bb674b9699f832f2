"""Limit the errors of public functions to ArmletError, TypeError, MemoryError, OSError, ImportError, and warnings raised as errors.

Each function checks its arguments. Another error, such as a ValueError of numpy, shows that a check is missing, which is a bug of armlet.
`border` converts such an error into an `InternalError`, as the extension converts a panic. Exceptions from functions of the caller, such
as a law in Python, and errors of gymnasium pass unchanged.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from functools import wraps
from types import TracebackType
from typing import Any, ParamSpec, TypeVar

from .errors import ArmletError, InternalError

__all__ = ["border", "bordered"]

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)

PASS = (ArmletError, TypeError, MemoryError, OSError, ImportError, Warning)
# Packages whose interfaces armlet implements. Their errors pass unchanged.
THEIRS = {"gymnasium"}
# Packages that armlet calls. If one of them raises an error that is not in `PASS`, armlet called it with invalid arguments.
OURS = sys.stdlib_module_names | {"armlet", "numpy", "matplotlib", "scipy", "pandas", "pyarrow", "xarray", "control", "rosbags"}


def border(function: Callable[P, R]) -> Callable[P, R]:
    """Wrap `function` so that every error that is not allowed leaves it as an `InternalError`.

    ArmletError, TypeError, MemoryError, OSError, ImportError and warnings are allowed. Errors of gymnasium and all errors from code of the
    caller are allowed too.
    """
    name = function.__qualname__.removesuffix(".__init__").removesuffix(".__post_init__")

    @wraps(function)
    def inside(*arguments: P.args, **keywords: P.kwargs) -> R:
        try:
            return function(*arguments, **keywords)
        except TypeError as error:
            # Without a further frame, the call itself failed, because of its arguments.
            if error.__traceback__ is None or error.__traceback__.tb_next is not None:
                raise
            message = _surplus(name, function, len(arguments))
            if not message:
                raise
            raise TypeError(message) from None
        except PASS:
            raise
        except Exception as error:
            if type(error).__module__.partition(".")[0] in THEIRS or _of_the_caller(error.__traceback__):
                raise
            message = f"{name}: internal error, please report it: {type(error).__name__}: {_words(error)}"
            raise InternalError(message) from error

    return inside


def _surplus(name: str, function: Callable[..., Any], given: int) -> str:
    """The message for more arguments without a name than `function` accepts, if it has keyword-only arguments; else empty."""
    parameters = list(inspect.signature(function).parameters.values())
    keywords_only = [f"{each.name}=" for each in parameters if each.kind is each.KEYWORD_ONLY]
    most = sum(each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD) for each in parameters)
    if given <= most or not keywords_only:
        return ""
    # The object of a method is an argument too, but the caller does not write it.
    own = parameters[:1] != [] and parameters[0].name in ("self", "cls")
    names = ", ".join(keywords_only)
    return f"{name}: expected at most {most - own} arguments without a name, got {given - own}: write the others by name: {names}"


def bordered(kind: C) -> C:
    """Apply `border` to the public methods and properties, `__call__` and the constructor of a class."""
    for name, value in list(vars(kind).items()):
        if name.startswith("_") and name not in ("__init__", "__post_init__", "__call__"):
            continue
        if isinstance(value, property) and value.fget is not None:
            setattr(kind, name, property(border(value.fget), value.fset, value.fdel, value.__doc__))
        elif isinstance(value, classmethod | staticmethod):
            setattr(kind, name, type(value)(border(value.__func__)))
        elif callable(value) and not isinstance(value, type):
            setattr(kind, name, border(value))
    return kind


def _of_the_caller(trace: TracebackType | None) -> bool:
    """Whether the traceback contains code of the caller: code outside armlet, the standard library and the packages that armlet calls."""
    while trace is not None:
        package = str(trace.tb_frame.f_globals.get("__name__", "")).partition(".")[0]
        if package not in OURS:
            return True
        trace = trace.tb_next
    return False


def _words(error: Any) -> str:
    try:
        return " ".join(str(error).split())[:500]
    except Exception:  # the error's own `__str__` failed
        return "without words"
