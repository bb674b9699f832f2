"""The public API as a list of callable targets.

Signatures come from the stubs of the extension and from the wrappers in `armlet.__all__`.
"""

from __future__ import annotations

import ast
import inspect
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import armlet as al

# Classes of results. Their methods are called, but not their constructors.
RESULTS = {
    "BaseParameters", "BatchRun", "DenseOutput", "ElasticLimits", "Equilibrium", "Events", "Identification", "Integration",
    "InverseKinematics", "Metrics", "ParameterReport", "PriorityDiagnosis", "PrioritySolution", "Run", "State", "Status", "SweepTable",
    "Tuning", "Verification", "Law", "Motion", "Plant", "TimedPath", "BangBangReport", "BangBangBatch", "ProfileReport", "TorqueOptimum",
    "ArmPrioritySolver", "LoopProgram", "Sensitivity", "RunIdentification", "WorstCase", "LogFit", "LogReport", "Refuted",
    "LoopMargins",
}  # fmt: skip
# Special methods that are called. Other names that begin with an underscore are private.
SLOTS = {"__call__", "__getitem__", "__eq__"}


@dataclass(frozen=True)
class Parameter:
    """One parameter. `kind` is "positional", "keyword" or "keywords". `annotation` is the text of its type."""

    name: str
    annotation: str
    kind: str
    required: bool


@dataclass(frozen=True)
class Target:
    """One target. `owner` is the class of a method, "" for a function or a constructor. An `attribute` is read instead of called."""

    owner: str
    name: str
    parameters: tuple[Parameter, ...]
    attribute: bool = False

    @property
    def path(self) -> str:
        return f"{self.owner}.{self.name}" if self.owner else self.name


def targets() -> list[Target]:
    """Every public function, constructor, method and property, sorted by name."""
    stubs, native = _of_stubs()
    found = {target.path: target for target in stubs}
    for name in al.__all__:
        thing = getattr(al, name)
        if isinstance(thing, type):
            if not issubclass(thing, Exception) and name not in native:
                found |= {target.path: target for target in _of_class(name, thing)}
        elif callable(thing) and not inspect.isbuiltin(thing):
            found[name] = Target("", name, _of_signature(thing))
    return [found[path] for path in sorted(found)]


def _of_stubs() -> tuple[list[Target], set[str]]:
    """The targets that the stubs declare, and the names of their classes."""
    found: list[Target] = []
    classes = set()
    for file in sorted((Path(al.__file__).parent / "_core").glob("*.pyi")):
        for node in ast.parse(file.read_text()).body:
            if isinstance(node, ast.FunctionDef) and node.name in al.__all__:
                found.append(Target("", node.name, _of_arguments(node)))
            elif isinstance(node, ast.ClassDef) and node.name in al.__all__:
                classes.add(node.name)
                found += [target for item in node.body if isinstance(item, ast.FunctionDef) and (target := _of_method(node.name, item))]
    return found, classes


def _of_method(owner: str, node: ast.FunctionDef) -> Target | None:
    marks = {mark.id for mark in node.decorator_list if isinstance(mark, ast.Name)}
    if node.name == "__new__":
        return None if owner in RESULTS else Target("", owner, _of_arguments(node)[1:])
    if node.name.startswith("_") and node.name not in SLOTS:
        return None
    if "property" in marks:
        return Target(owner, node.name, (), attribute=True)
    return Target(owner, node.name, _of_arguments(node)[0 if "staticmethod" in marks else 1 :])


def _of_arguments(node: ast.FunctionDef) -> tuple[Parameter, ...]:
    given = node.args
    plain = [*given.posonlyargs, *given.args]
    first_optional = len(plain) - len(given.defaults)

    def one(argument: ast.arg, kind: str, required: bool) -> Parameter:
        return Parameter(argument.arg, ast.unparse(argument.annotation) if argument.annotation else "", kind, required)

    found = [one(argument, "positional", i < first_optional) for i, argument in enumerate(plain)]
    found += [one(a, "keyword", default is None) for a, default in zip(given.kwonlyargs, given.kw_defaults, strict=True)]
    return tuple(found) + ((one(given.kwarg, "keywords", False),) if given.kwarg else ())


def _of_class(name: str, thing: type) -> list[Target]:
    found = []
    if name not in RESULTS:
        found.append(Target("", name, _of_signature(thing)))
    for method in dir(thing):
        value = inspect.getattr_static(thing, method)
        inherited = any(method in vars(base) for base in (dict, tuple, int, object))
        if (method.startswith("_") and method not in SLOTS) or inherited or not hasattr(thing, method):
            continue
        if isinstance(value, property):
            found.append(Target(name, method, (), attribute=True))
        elif inspect.isfunction(value):
            found.append(Target(name, method, _of_signature(value)[1:]))
        elif isinstance(value, classmethod | staticmethod):
            found.append(Target(name, method, _of_signature(getattr(thing, method))))
    return found


def _of_signature(thing: Any) -> tuple[Parameter, ...]:
    found = []
    for p in inspect.signature(thing).parameters.values():
        if p.kind is p.VAR_POSITIONAL:
            continue
        kind = {p.KEYWORD_ONLY: "keyword", p.VAR_KEYWORD: "keywords"}.get(p.kind, "positional")
        annotation = "" if p.annotation is p.empty else str(p.annotation)
        found.append(Parameter(p.name, annotation, kind, p.default is p.empty and kind != "keywords"))
    return tuple(found)
