"""Docstrings of public functions and constructors have all parts. `docstrings_missing.toml` lists the missing parts, and only shrinks.

The parts are `args` (an entry for every argument of the signature, in a long list with the main ones apart from the others), `returns`
(functions), `raises`, `source` (`Source: ..`, or a key of docs/references.bib) and `example`. Classes of results, which only armlet
constructs, are not checked. Methods of classes written in Python have `args` and `returns`; the class has source and example.
"""

from __future__ import annotations

import inspect
import re
import tomllib
from itertools import chain
from pathlib import Path
from typing import Any

import pytest

import armlet as al

ROOT = Path(__file__).resolve().parents[2]
KEYS = set(re.findall(r"^@\w+\{([^,]+),", (ROOT / "docs/references.bib").read_text(), re.MULTILINE))
ALLOWED: dict[str, list[str]] = tomllib.loads((Path(__file__).parent / "docstrings_missing.toml").read_text())
SECTION = r"^{}:\n((?:    .*\n|\n)+)"
#: A longer list of arguments has its main arguments in `Args:`, and the others in `Other Args:`.
LONGEST = 11


def callables() -> list[str]:
    """Names of public functions, and of classes whose docstring has arguments of a constructor."""
    found = []
    for name in al.__all__:
        thing = getattr(al, name)
        if inspect.isclass(thing) and issubclass(thing, Exception):
            continue
        if inspect.isroutine(thing) or (inspect.isclass(thing) and "Args:" in (thing.__doc__ or "")):
            found.append(name)
    return sorted(found)


def parameters(thing: Any) -> list[str]:
    return [each.name for each in inspect.signature(thing).parameters.values() if each.kind not in (each.VAR_KEYWORD, each.VAR_POSITIONAL)]


def missing(text: str, names: list[str], function: bool) -> list[str]:
    """The parts that a docstring lacks."""
    text = inspect.cleandoc(text) + "\n"
    found = [re.search(SECTION.format(name), text, re.MULTILINE) for name in ("Args", "Other Args")]
    lists = [re.findall(r"^    (?! )([\w, *]+):", section.group(1) if section else "", re.MULTILINE) for section in found]
    described = {name.strip(" *") for entry in chain(*lists) for name in entry.split(",")}
    cited = {key for group in re.findall(r"\[([\w, ]+)\]", text) for key in group.split(", ")}
    present = {
        "args": set(names) <= described and len(lists[0]) <= LONGEST,
        "returns": not function or bool(re.search(SECTION.format("Returns"), text, re.MULTILINE)),
        "raises": bool(re.search(SECTION.format("Raises"), text, re.MULTILINE)),
        "source": bool(re.search(r"^Source: \S|^Source:\n    \S", text, re.MULTILINE)) or bool(cited & KEYS),
        "example": ">>>" in text,
    }
    return [part for part, there in present.items() if not there]


def lacks(name: str) -> list[str]:
    thing = getattr(al, name)
    return missing(thing.__doc__ or "", parameters(thing), function=not inspect.isclass(thing))


def methods() -> dict[str, Any]:
    """Public methods of the public classes that are written in Python, by `Class.method`."""
    found = {}
    for name in al.__all__:
        members = vars(getattr(al, name)) if inspect.isclass(getattr(al, name)) else {}
        for member, value in members.items():
            function = value.__func__ if isinstance(value, classmethod | staticmethod) else value
            if inspect.isfunction(function) and not member.startswith("_"):
                found[f"{name}.{member}"] = inspect.unwrap(function)
    return found


def method_lacks(method: Any) -> list[str]:
    names = [name for name in parameters(method) if name not in ("self", "cls")]
    silent = inspect.signature(method).return_annotation in (None, "None")
    return [part for part in missing(method.__doc__ or "", names, function=not silent) if part in ("args", "returns")]


@pytest.mark.parametrize("name", methods())
def test_method_has_arguments_and_returns(name: str) -> None:
    assert method_lacks(methods()[name]) == ALLOWED.get(name, [])


@pytest.mark.parametrize("name", callables())
def test_docstring_has_all_parts(name: str) -> None:
    assert lacks(name) == ALLOWED.get(name, [])


def indented(text: str) -> list[str]:
    """Lines of a docstring that are indented below a line that opens no list: Sphinx reports an unexpected indentation."""
    return re.findall(r"^\S.*[^:\n]\n +(\S.*)", inspect.cleandoc(text).split("\n>>>")[0], re.MULTILINE)


def test_paragraphs_have_one_indentation() -> None:
    texts = {name: getattr(al, name).__doc__ for name in al.__all__ if callable(getattr(al, name))}
    for name in [name for name in texts if inspect.isclass(getattr(al, name))]:
        members = {member: value for member, value in vars(getattr(al, name)).items() if not member.startswith("_")}
        texts |= {f"{name}.{member}": v.__doc__ for member, v in members.items() if inspect.isroutine(v) or inspect.isdatadescriptor(v)}
    assert len(texts) > 300
    assert {name: lines for name, text in texts.items() if (lines := indented(text or ""))} == {}


def test_indented_lines_are_detected() -> None:
    assert indented("Sum.\n\nLong text that\n    goes on.\n\nArgs:\n    x: m.\n") == ["goes on."]
    assert indented(FULL) == []


def test_allowances_name_what_exists() -> None:
    assert set(ALLOWED) <= {*callables(), *methods()}
    assert len(methods()) > 30
    assert len(callables()) > 60


FULL = """Sum.

Args:
    x, y: numbers, (n,), m.
    scale: a factor.

Returns:
    Their sum, m.

Raises:
    InputError: no numbers.

Source: docs/conventions.md.

>>> 1 + 1
2
"""


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (FULL, []),
        (FULL.replace("    scale: a factor.\n", ""), ["args"]),
        (FULL.replace("    scale: a factor.\n", "\nOther Args:\n    scale: a factor.\n"), []),
        (FULL.replace("    x, y:", "".join(f"    z{i}: a number.\n" for i in range(10)) + "    x, y:"), ["args"]),
        (FULL.replace("Returns:\n    Their sum, m.\n\n", ""), ["returns"]),
        (FULL.replace("Raises:", "Errors:"), ["raises"]),
        (FULL.replace("Source: docs/conventions.md.", ""), ["source"]),
        (FULL.replace("Source: docs/conventions.md.", "As in [Spong1987]."), []),
        (FULL.replace("Source: docs/conventions.md.", "As in [Nobody1987]."), ["source"]),
        (FULL.replace(">>> 1", "1"), ["example"]),
        ("", ["args", "returns", "raises", "source", "example"]),
    ],
)
def test_missing_parts_are_detected(text: str, expected: list[str]) -> None:
    assert missing(text, ["x", "y", "scale"], function=True) == expected
