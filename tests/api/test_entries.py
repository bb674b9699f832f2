"""Every function and special method of the extension has the attribute `#[entered]`, which converts a panic to an `InternalError`.

pyo3 would raise a `PanicException`, which is not an `Exception`. The unit tests of `rust/macros` show that the attribute works. pyo3
converts arguments before the body runs. So a signature may only have types whose conversion cannot panic or abort.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_layering import without_comments

import armlet as al
from armlet import _core

BINDING = Path(__file__).resolve().parents[2] / "rust" / "py" / "src"
SOURCES = sorted(BINDING.rglob("*.rs"))

# Valid types of arguments: a reference to an object, a number, a flag, a text. The caller cannot make them arbitrarily large.
READ = re.compile(
    r"""(?:mut\s+)?_?\w+\s*:\s*(?:Option<)?
    (?:Python<'\w+>|Outs<'_,\s*'py>|&\s*(?:'\w+\s+)?Bound<'\w+,\s*\w+>|Bound<'\w+,\s*\w+>|PyRef<'\w+,\s*\w+>|Py<\w+>|f64|bool|usize|u64|i64|isize|u32|&\s*(?:'\w+\s+)?str
    |\[f64;\s*\d+\]|CompareOp)>?,?$""",
    re.VERBOSE,
)


def not_entered(source: str) -> list[str]:
    """The lines `#[pymethods]` and `#[pyfunction]` without the attribute `#[entered]` above them."""
    lines = without_comments(source).split("\n")
    marks = [i for i, line in enumerate(lines) if re.match(r"\s*#\[(pymethods|pyfunction)", line)]
    return [lines[i] for i in marks if i == 0 or lines[i - 1].strip() != "#[entered]"]


def signatures(source: str) -> list[tuple[str, list[str]]]:
    """The functions that Python can call: names and arguments."""
    text = without_comments(source)
    found = []
    for mark in re.finditer(r"#\[(pymethods|pyfunction)\b", text):
        if mark.group(1) == "pyfunction":
            end = text.index("{", mark.end())
        else:
            depth, end = 1, text.index("{", mark.end()) + 1
            while depth:
                depth += (text[end] == "{") - (text[end] == "}")
                end += 1
        for function in re.finditer(r"\bfn\s+(\w+)\s*(?:<[^(]*>)?\s*\(", text[mark.end() : end]):
            start = mark.end() + function.end()
            depth, stop = 1, start
            while depth:
                depth += (text[stop] in "([<") - (text[stop] in ")]>" and text[stop - 1 : stop + 1] != "->")
                stop += 1
            depth, arguments, item = 0, [], ""
            for character in text[start : stop - 1]:
                depth += (character in "([<") - (character in ")]>")
                if character == "," and depth == 0:
                    arguments.append(item.strip())
                    item = ""
                else:
                    item += character
            arguments.append(item.strip())
            found.append((function.group(1), [each for each in arguments if each and not re.fullmatch(r"&?(mut )?self", each)]))
    return found


def test_every_entry_point_is_entered() -> None:
    missing = {path.name: found for path in SOURCES if (found := not_entered(path.read_text()))}
    assert missing == {}
    assert sum(path.read_text().count("#[entered]") for path in SOURCES) > 70


def test_arguments_are_read_inside() -> None:
    outside = {}
    for path in SOURCES:
        for name, arguments in signatures(path.read_text()):
            bad = [each for each in arguments if not READ.match(re.sub(r"\s+", " ", each))]
            # Functions that read a pickle are exempt. A pickle has a checksum, and is read as tuples of fixed lengths.
            if bad and not name.startswith("_restore"):
                outside[f"{path.name}:{name}"] = bad
    assert outside == {}


def test_signatures_are_written_once() -> None:
    """`#[arguments(..)]` makes the text of a signature. The stubs are compared with these texts by mypy's stubtest."""
    assert [path.name for path in SOURCES if "text_signature" in without_comments(path.read_text())] == []
    assert sum(path.read_text().count("#[arguments(") for path in SOURCES) > 90


def test_rules_see_planted_violations() -> None:
    good = "#[entered]\n#[pymethods]\nimpl A {\n    fn f(&self, x: &Bound<'_, PyAny>, n: Option<usize>) -> f64 { 1.0 }\n}\n"
    assert not_entered(good) == [] and all(READ.match(each) for _, each_of in signatures(good) for each in each_of)
    assert not_entered("#[pymethods]\nimpl A {}\n") != []
    assert not_entered("#[entered]\n#[pymethods]\nimpl A {}\n\n#[pyfunction]\nfn f() {}\n") != []
    bad = signatures("#[entered]\n#[pyfunction]\nfn f<'py>(py: Python<'py>, x: Vec<usize>, y: &str) -> f64 { 1.0 }\n")
    assert [name for name, _ in bad] == ["f"] and [bool(READ.match(each)) for each in bad[0][1]] == [True, False, True]


def slots(kind: type) -> list[str]:
    """The special methods of a class of the extension, without its constructors."""
    return [name for name, value in vars(kind).items() if name.startswith("__") and callable(value) and name not in ("__new__", "__init__")]


ARM = al.planar_arm([1.0, 1.0])
HOLD = al.Hold([0.5, 0.5])


def objects() -> list[Any]:
    """One object of each class that has a simple constructor."""
    law, plant = al.PDGravity(ARM, [0.5, 0.5], 1.0, 1.0), al.RigidArm(ARM)
    return [
        ARM,
        HOLD,
        law,
        plant,
        al.Task("link2", "xy"),
        al.PrioritySolver(2, [1]),
        al.PrioritySolver.for_arm(ARM, [al.Task("link2", "xy")]),
        al.solve_priority([[[1.0, 0.0]]], [[1.0]]),
        al.bang_bang_time(0.0, 1.0, 1.0, 1.0, 3.0),
        al.bang_bang_time(0.0, [1.0, 2.0], 1.0, 1.0, 3.0),
        al.torque_optimal_time(0.0, 1.0, 1.0, 1.0, 3.0),
        al.Simulator(plant, law, [0.0, 0.0], dt=1e-3),
        al.time_path(ARM, [[0.0, 0.0], [0.5, 0.5], [1.0, 0.0]], tau_max=100.0),
        al.inverse_kinematics(ARM, [al.Task("link2", "xy", [1.0, 0.5])], [0.1, 0.2]),
    ]


class Vast:
    """A sequence with the largest possible length and endless entries."""

    def __len__(self) -> int:
        return 2**62

    def __getitem__(self, i: int) -> float:
        return 0.5


ODD: list[Any] = [None, True, -1, 2**70, 1.5, "x", b"x", [], (), {}, Vast(), range(10**15), np.ma.masked, np.zeros((0, 2)), [[]], object()]


@pytest.mark.parametrize("made", objects(), ids=lambda made: type(made).__name__)
def test_odd_arguments_of_methods_raise_exceptions(made: Any) -> None:
    """Every method is called with each odd argument at every position. It returns a value or raises an exception, but no PanicException."""
    kind = type(made)
    methods = [name for name in dir(kind) if not name.startswith("_") and callable(getattr(kind, name))]
    for name in [*methods, *slots(kind)]:
        for odd in ODD:
            for count in range(4):
                try:
                    getattr(made, name)(*[odd] * count)
                except Exception as error:
                    assert not isinstance(error, al.InternalError), (name, odd, count, error)


def test_odd_arguments_of_functions_raise_exceptions() -> None:
    functions = {name: value for name, value in vars(_core).items() if callable(value) and name != "_restore"}
    assert len(functions) > 60
    for name, function in functions.items():
        for odd in ODD:
            for count in range(7):
                try:
                    function(*[odd] * count)
                except Exception as error:
                    assert not isinstance(error, al.InternalError), (name, odd, count, error)


def test_every_class_of_the_extension_has_slots_of_its_own() -> None:
    """The classes of the extension have many special methods, which the test above calls. So that test is not empty."""
    assert sum(len(slots(value)) for value in vars(_core).values() if inspect.isclass(value)) > 60
