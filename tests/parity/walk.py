"""What is public, and what a test speaks of: the two lists that `test_coverage.py` compares.

A name is `function`, `Class`, `Arm.method`, `Class.maker` (a class or static method), or one of these with an optional argument:
`simulate(tau_max)`.
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
        members = {}
        if entry is al.Arm:
            members = {member: getattr(entry, member) for member in dir(entry) if not member.startswith("_")}
        elif inspect.isclass(entry):
            made = {m: v for m, v in vars(entry).items() if isinstance(v, (classmethod, staticmethod)) and not m.startswith("_")}
            members = {member: getattr(entry, member) for member in made}
        calls = {name: entry} | {f"{name}.{member}": value for member, value in members.items()}
        for called, value in calls.items():
            error = inspect.isclass(value) and issubclass(value, BaseException)
            found += [called, *(f"{called}({argument})" for argument in ([] if error else optional(value)))]
    return found


def words(name: str) -> set[str]:
    """What a test that covers this name has to speak of: the last name before the bracket, and the argument."""
    call, _, argument = name.rstrip(")").partition("(")
    return {call.rpartition(".")[2], *([argument] if argument else [])}


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
