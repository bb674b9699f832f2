"""What is public, and what a test speaks of: the two lists that `test_coverage.py` compares.

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
# Classes whose objects tests make by name.
MADE = (al.Law, al.Motion, al.Simulator, al.PrioritySolver)
DEFINES = (ast.FunctionDef, ast.ClassDef)


def optional(entry: Any) -> list[str]:
    """The arguments of a callable that may be left out."""
    try:
        parameters = inspect.signature(entry).parameters.values()
    except (TypeError, ValueError):
        return []
    return [p.name for p in parameters if p.default is not p.empty or p.kind is p.VAR_KEYWORD]


def public() -> list[str]:
    """Every name that the table must have."""
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
    """The methods that armlet gives a class, calls of its objects included; of `Arm` the properties too."""
    own = {member for base in entry.__mro__ if base.__module__.startswith("armlet") for member in vars(base)}
    names = [member for member in dir(entry) if member in own and (member == "__call__" or not member.startswith("_"))]
    return {member: getattr(entry, member) for member in names if entry is al.Arm or callable(getattr(entry, member))}


def words(name: str) -> set[str]:
    """What a test that covers this name has to speak of: the last name before the bracket, and the argument.

    A method of an object that tests make by its class needs the class too; a call needs the class alone.
    """
    call, _, argument = name.rstrip(")").partition("(")
    owner, _, last = call.rpartition(".")
    made = [owner] if issubclass(getattr(al, owner, object), MADE) and owner not in ("Law", "Motion") else []
    return {*made, *([last] if last != "__call__" else []), *([argument] if argument else [])}


@cache
def definitions(path: Path) -> dict[str, list[ast.stmt]]:
    """The statements of a test file by the names that they define; imports from neighbours lead there."""
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
    """The identifiers in a test and in everything of its file that it uses; None if there is no such test."""
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
    """Whether a test file imports the reference, itself or through a neighbour."""
    text = path.read_text()
    if re.search(r"^(from armlet import .*\breference\b|from armlet\.reference|import armlet\.reference)", text, re.MULTILINE):
        return True
    return any(
        compares_with_reference(path.parent / f"{module}.py")
        for module in re.findall(r"^from (\w+) import", text, re.MULTILINE)
        if (path.parent / f"{module}.py").exists()
    )
