"""List the public names of armlet, and the identifiers in a test: the two lists that `test_coverage.py` compares.

A name is `function`, `Class`, `Class.method`, `Class.__call__`, or one of these with an optional argument: `simulate(tau_max)`.
A class that inherits a method lists it without arguments.
"""

from __future__ import annotations

import ast
import inspect
import re
from functools import cache
from pathlib import Path
from typing import Any

import armlet as al

HERE = Path(__file__).parent
# For these classes a test must name the class, too, since it constructs the objects itself.
MADE = (al.Law, al.Motion, al.Simulator, al.PrioritySolver)
DEFINES = (ast.FunctionDef, ast.ClassDef)


def optional(entry: Any) -> list[str]:
    """Return the names of the optional arguments of a callable."""
    try:
        parameters = inspect.signature(entry).parameters.values()
    except (TypeError, ValueError):
        return []
    return [p.name for p in parameters if p.default is not p.empty or p.kind is p.VAR_KEYWORD]


def public() -> list[str]:
    """Return every name that the table must contain."""
    found = []
    for name in al.__all__:
        entry = getattr(al, name)
        error = inspect.isclass(entry) and issubclass(entry, BaseException)
        members = methods(entry) if inspect.isclass(entry) and not error else {}
        calls = {name: entry} | {f"{name}.{member}": value for member, value in members.items()}
        for called, value in calls.items():
            inherited = value is not entry and called.rpartition(".")[2] not in vars(entry)
            found += [called, *(f"{called}({argument})" for argument in ([] if error or inherited else optional(value)))]
    return found


def methods(entry: type) -> dict[str, Any]:
    """Return the methods of a class that armlet defines, including `__call__`. For `Arm` the properties are included."""
    own = {member for base in entry.__mro__ if base.__module__.startswith("armlet") for member in vars(base)}
    names = [member for member in dir(entry) if member in own and (member == "__call__" or not member.startswith("_"))]
    return {member: getattr(entry, member) for member in names if entry is al.Arm or callable(getattr(entry, member))}


def words(name: str) -> set[str]:
    """Return the identifiers that a test of this name must contain: the last name before the bracket, and the argument.

    For a method of a class in `MADE`, this includes the class. For `__call__`, it is the class alone.
    """
    call, _, argument = name.rstrip(")").partition("(")
    owner, _, last = call.rpartition(".")
    made = [owner] if issubclass(getattr(al, owner, object), MADE) and owner not in ("Law", "Motion") else []
    return {*made, *([last] if last != "__call__" else []), *([argument] if argument else [])}


@cache
def definitions(path: Path) -> dict[str, list[ast.stmt]]:
    """Return the statements of a test file by the names that they define. Imports from the same folder are followed."""
    found: dict[str, list[ast.stmt]] = {}
    for statement in ast.parse(path.read_text()).body:
        if isinstance(statement, DEFINES):
            found.setdefault(statement.name, []).append(statement)
        elif isinstance(statement, ast.Assign | ast.AnnAssign):
            targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            for target in targets:
                if isinstance(target, ast.Name):
                    found.setdefault(target.id, []).append(statement)
        elif isinstance(statement, ast.ImportFrom) and (path.parent / f"{statement.module}.py").exists():
            neighbour = definitions(path.parent / f"{statement.module}.py")
            for alias in statement.names:
                found.setdefault(alias.asname or alias.name, []).extend(neighbour.get(alias.name, []))
    return found


@cache
def spoken(path: Path, test: str) -> frozenset[str] | None:
    """Return the identifiers in a test and in all definitions that it uses, or None if the file has no such test."""
    own = definitions(path)
    if test not in own or not test.startswith("test_"):
        return None
    found: set[str] = set()
    waiting, seen = [test], {test}
    while waiting:
        for statement in own[waiting.pop()]:
            for node in ast.walk(statement):
                match node:
                    case ast.Name(id=word) | ast.Attribute(attr=word) | ast.keyword(arg=str(word)):
                        found.add(word)
                    case ast.Constant(value=str(text)) if re.fullmatch(r"\w+", text):
                        found.add(text)
        for word in found & own.keys() - seen:
            seen.add(word)
            waiting.append(word)
    return frozenset(found)


def compares_with_reference(path: Path) -> bool:
    """Return whether a test file imports the reference, directly or through a file of the same folder."""
    text = path.read_text()
    if re.search(r"^(from armlet import .*\breference\b|from armlet\.reference|import armlet\.reference)", text, re.MULTILINE):
        return True
    return any(
        compares_with_reference(path.parent / f"{module}.py")
        for module in re.findall(r"^from (\w+) import", text, re.MULTILINE)
        if (path.parent / f"{module}.py").exists()
    )
