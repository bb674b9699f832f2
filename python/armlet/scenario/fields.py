"""The valid values of the keys of a scenario. A `Field` checks a value, and returns its rule as JSON schema.

`check(value, path)` yields problems, which begin with their path, such as `path: expected .., got ..`. It does not convert values.
The constructors of laws, plants and motions check the shapes that depend on the arm. `pathed` of `scenario.py` adds the path of the key
to their messages.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from ..arguments import shown as quoted
from ..errors import InputError

__all__ = ["Entries", "Field", "Flag", "Integer", "Items", "Keyed", "Kind", "Numbers", "OneOf", "Table", "Text", "Values", "shown"]


def shown(value: object) -> str:
    """Return a short text of `value` for a message."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        return f"a table with the keys {', '.join(map(str, value))}" if value else "an empty table"
    return quoted(value)


def _number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _float(value: Any) -> float:
    """Return a number as a float. An integer beyond the range of floats becomes infinite."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


class Field:
    """Base class: the valid values of one key."""

    def check(self, value: object, path: str) -> Iterator[str]:
        """Yield the problems of `value`. Each begins with the path of the problem."""
        raise NotImplementedError

    def schema(self) -> dict[str, Any]:
        """Return the valid values as a JSON schema."""
        raise NotImplementedError


@dataclass(frozen=True)
class Numbers(Field):
    """A number, or nested lists of numbers down to `depth` levels.

    Without `scalar`, a plain number is not valid. `low` is the lower bound of a number and of the entries of a list, not of a matrix. It is
    excluded if `strict`.
    """

    depth: int = 0
    scalar: bool = True
    low: float = -math.inf
    strict: bool = False
    finite: bool = True

    def check(self, value: object, path: str) -> Iterator[str]:
        if not self._is_plain(value):
            yield from self._check(value, path, 0)

    def _is_plain(self, value: object) -> bool:
        """Whether the value is a valid list of Python floats, or one valid float. This is fast, because sweeps check every cell."""
        if type(value) is float and self.scalar:
            value = [value]
        elif type(value) is not list or not self.depth:
            return False
        if {*map(type, value)} != {float}:
            return False
        least = min(value)
        return all(map(math.isfinite, value)) and (least > self.low or (not self.strict and least == self.low))

    def _check(self, value: object, path: str, level: int) -> Iterator[str]:
        if isinstance(value, list | tuple) and level < self.depth:
            if not value:
                yield f"{path}: expected {self._expected()}, got an empty list"
            for i, item in enumerate(value):
                # A list contains only numbers or only rows, as its first entry does.
                if level + 1 < self.depth and isinstance(item, list | tuple) is not isinstance(value[0], list | tuple):
                    yield f"{path}[{i}]: expected {'a row' if isinstance(value[0], list) else 'a number'} like [0], got {shown(item)}"
                else:
                    yield from self._check(item, f"{path}[{i}]", level + 1)
        elif not _number(value) or (level == 0 and not self.scalar):
            yield f"{path}: expected {self._expected() if level == 0 else 'a number'}, got {shown(value)}"
        else:
            number = _float(value)
            # Entries of a matrix may have any sign. The constructor checks that the matrix is positive definite.
            below = level < 2 and (number < self.low or (self.strict and number <= self.low))
            if (self.finite and not math.isfinite(number)) or math.isnan(number):
                yield f"{path}: expected a finite number, got {number}"
            elif below:
                yield f"{path}: expected {'>' if self.strict else '>='} {self.low:g}, got {shown(value)}"

    def _expected(self) -> str:
        lists = {0: "", 1: "a list of numbers", 2: "a list of numbers or of rows"}[min(self.depth, 2)]
        return " or ".join(filter(None, ("a number" if self.scalar else "", lists)))

    def schema(self) -> dict[str, Any]:
        number: dict[str, Any] = {"type": "number"}
        if self.low > -math.inf:
            number["exclusiveMinimum" if self.strict else "minimum"] = self.low
        forms = [number] if self.scalar else []
        below = number
        for level in range(self.depth):
            below = {"type": "array", "items": {"type": "number"} if level else below, "minItems": 1}
            if level:
                below = {"type": "array", "items": {"type": "array", "items": {"type": "number"}}, "minItems": 1}
            forms.append(below)
        return forms[0] if len(forms) == 1 else {"anyOf": forms}


@dataclass(frozen=True)
class Integer(Field):
    """An integer >= `low`."""

    low: int = 0

    def check(self, value: object, path: str) -> Iterator[str]:
        if not isinstance(value, int) or isinstance(value, bool) or value < self.low:
            yield f"{path}: expected an integer >= {self.low}, got {shown(value)}"

    def schema(self) -> dict[str, Any]:
        return {"type": "integer", "minimum": self.low}


@dataclass(frozen=True)
class Text(Field):
    """A string, or one of `choices` if there are any."""

    choices: tuple[str, ...] = ()

    def check(self, value: object, path: str) -> Iterator[str]:
        if self.choices and value not in self.choices:
            yield f"{path}: expected one of {', '.join(self.choices)}, got {shown(value)}"
        elif not isinstance(value, str) or not value:
            yield f"{path}: expected a string, got {shown(value)}"

    def schema(self) -> dict[str, Any]:
        return {"enum": list(self.choices)} if self.choices else {"type": "string", "minLength": 1}


@dataclass(frozen=True)
class Flag(Field):
    """True or false."""

    def check(self, value: object, path: str) -> Iterator[str]:
        if not isinstance(value, bool):
            yield f"{path}: expected true or false, got {shown(value)}"

    def schema(self) -> dict[str, Any]:
        return {"type": "boolean"}


@dataclass(frozen=True)
class FlagOrNames(Field):
    """True, false, or a list of some of `choices`."""

    choices: tuple[str, ...] = ()

    def check(self, value: object, path: str) -> Iterator[str]:
        listed = isinstance(value, list) and all(isinstance(name, str) and name in self.choices for name in value)
        if not isinstance(value, bool) and not listed:
            yield f"{path}: expected true, false, or a list of {', '.join(self.choices)}, got {shown(value)}"

    def schema(self) -> dict[str, Any]:
        return {"anyOf": [{"type": "boolean"}, {"type": "array", "items": {"enum": list(self.choices)}}]}


@dataclass(frozen=True)
class Names(Field):
    """A list of strings."""

    def check(self, value: object, path: str) -> Iterator[str]:
        if not isinstance(value, list | tuple) or not value or not all(isinstance(name, str) and name for name in value):
            yield f"{path}: expected a list of names, got {shown(value)}"

    def schema(self) -> dict[str, Any]:
        return {"type": "array", "items": {"type": "string", "minLength": 1}, "minItems": 1}


@dataclass(frozen=True)
class Table(Field):
    """A table with the keys `keys`. The keys in `required` must be present."""

    keys: Mapping[str, Field]
    required: tuple[str, ...] = ()

    def check(self, value: object, path: str) -> Iterator[str]:
        if not isinstance(value, Mapping):
            yield f"{path}: expected a table with the keys {', '.join(self.keys)}, got {shown(value)}"
            return
        yield from self.check_keys(value, path, self.keys)

    def check_keys(self, value: Mapping[Any, object], path: str, allowed: Mapping[str, Field]) -> Iterator[str]:
        for key, item in value.items():
            if key not in allowed:
                near = difflib.get_close_matches(str(key), allowed, 1)
                hint = f" (did you mean {near[0]}?)" if near else ""
                yield f"{path}: unknown key {key!r}{hint}: expected some of {', '.join(allowed) or 'none'}"
            else:
                yield from allowed[key].check(item, f"{path}.{key}")
        for key in self.required:
            if key not in value:
                yield f"{path}.{key}: is missing: expected {_wanted(self.keys[key])}"

    def schema(self) -> dict[str, Any]:
        properties = {key: what.schema() for key, what in self.keys.items()}
        return {"type": "object", "properties": properties, "required": list(self.required), "additionalProperties": False}


@dataclass(frozen=True)
class Kind(Table):
    """A table that describes one object, which `make(**values)` makes. The key `kind` of a table selects the `Kind`.

    `needs` are names of other tables of the scenario, whose objects are further arguments of `make`.
    """

    make: Callable[..., Any] = dict
    needs: tuple[str, ...] = ()


@dataclass(frozen=True)
class OneOf(Field):
    """A table whose other keys depend on its key `kind`."""

    kinds: Mapping[str, Kind]

    def make(self, table: Mapping[str, Any], **others: Any) -> Any:
        """Make the object of a table. `others` contains the objects of other tables. Those named in the kind's `needs` are used."""
        name = table["kind"]
        kind = self.kinds[name]
        if missing := [need for need in kind.needs if need not in others]:
            raise InputError(f"{name}: kind is not possible here: expected a kind without {' and '.join(missing)}, got {name}")
        values = {key: value for key, value in table.items() if key != "kind"}
        return kind.make(**{need: others[need] for need in kind.needs}, **values)

    def check(self, value: object, path: str) -> Iterator[str]:
        names = ", ".join(self.kinds)
        if not isinstance(value, Mapping):
            yield f"{path}: expected a table with kind = one of {names}, got {shown(value)}"
        elif "kind" not in value:
            yield f"{path}.kind: is missing: expected one of {names}"
        elif not isinstance(value["kind"], str) or value["kind"] not in self.kinds:
            near = difflib.get_close_matches(str(value["kind"]), self.kinds, 1)
            yield f"{path}.kind: expected one of {names}, got {shown(value['kind'])}" + (f" (did you mean {near[0]}?)" if near else "")
        else:
            kind = self.kinds[value["kind"]]
            yield from kind.check_keys({key: item for key, item in value.items() if key != "kind"}, path, kind.keys)

    def schema(self) -> dict[str, Any]:
        forms = []
        for name, kind in self.kinds.items():
            form = kind.schema()
            form["properties"] = {"kind": {"const": name}} | form["properties"]
            form["required"] = ["kind", *form["required"]]
            forms.append(form)
        return {"type": "object", "properties": {"kind": {"enum": list(self.kinds)}}, "required": ["kind"], "oneOf": forms}


@dataclass(frozen=True)
class Items(Field):
    """A list of at least `low` tables, each of the form `item`."""

    item: Field
    low: int = 1

    def check(self, value: object, path: str) -> Iterator[str]:
        if not isinstance(value, list | tuple) or len(value) < self.low:
            yield f"{path}: expected a list of at least {self.low} tables, got {shown(value)}"
            return
        for i, each in enumerate(value):
            yield from self.item.check(each, f"{path}[{i}]")

    def schema(self) -> dict[str, Any]:
        return {"type": "array", "items": self.item.schema(), "minItems": self.low}


@dataclass(frozen=True)
class Keyed(Field):
    """A table with arbitrary keys, whose values all have the form `item`."""

    item: Field

    def check(self, value: object, path: str) -> Iterator[str]:
        if not isinstance(value, Mapping) or not value:
            yield f"{path}: expected a table with at least one entry, got {shown(value)}"
            return
        for key, each in value.items():
            yield from self.item.check(each, f'{path}."{key}"')

    def schema(self) -> dict[str, Any]:
        return {"type": "object", "additionalProperties": self.item.schema(), "minProperties": 1}


@dataclass(frozen=True)
class Values(Field):
    """A list of arbitrary values."""

    def check(self, value: object, path: str) -> Iterator[str]:
        if not isinstance(value, list | tuple) or not value:
            yield f"{path}: expected a list of values, or a table such as {{ linspace = [0, 1, 5] }}, got {shown(value)}"

    def schema(self) -> dict[str, Any]:
        return {"type": "array", "minItems": 1}


@dataclass(frozen=True)
class Entries(Field):
    """A value in one of several forms. Its type selects the field of `forms` that checks it.

    The keys of `forms` are "table", "tables" (a list of tables), "text" (a string), and "plain" for all other values. "plain" also checks
    the values of a form that `forms` lacks.
    """

    forms: Mapping[str, Field] = field(default_factory=dict)

    def check(self, value: object, path: str) -> Iterator[str]:
        name = "table" if isinstance(value, Mapping) else "text" if isinstance(value, str) else "plain"
        if isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
            name = "tables"
        yield from self.forms.get(name, self.forms["plain"]).check(value, path)

    def schema(self) -> dict[str, Any]:
        return {"anyOf": [form.schema() for form in self.forms.values()]}


def _wanted(what: Field) -> str:
    """A text that describes the valid values of a missing key."""
    if isinstance(what, Numbers):
        return what._expected()
    if isinstance(what, Text):
        return f"one of {', '.join(what.choices)}" if what.choices else "a string"
    if isinstance(what, OneOf):
        return f"a table with kind = one of {', '.join(what.kinds)}"
    if isinstance(what, Table):
        return f"a table with the keys {', '.join(what.keys)}"
    return {"Integer": "an integer", "Flag": "true or false", "Items": "a list of tables"}.get(type(what).__name__, "a value")
