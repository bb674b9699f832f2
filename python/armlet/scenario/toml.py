"""Write tables as TOML text. `tomllib` of the standard library reads TOML only."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any

__all__ = ["toml_text"]

BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(tables: Mapping[str, Any]) -> str:
    """Return tables as TOML. Values are numbers, texts, true or false, lists, and tables. Reading the text returns equal values."""
    return _table(tables, ()).lstrip("\n")


def _table(table: Mapping[str, Any], path: tuple[str, ...]) -> str:
    """Return the lines of a table. Its values come first, then its tables, because a header ends the values of its parent."""
    plain = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    inner = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    head = f"\n[{'.'.join(map(_key, path))}]\n" if path and (plain or not inner) else ""
    lines = "".join(f"{_key(key)} = {_value(value)}\n" for key, value in plain.items())
    return head + lines + "".join(_table(each, (*path, key)) for key, each in inner.items())


def _key(key: str) -> str:
    return key if BARE.fullmatch(key) else _text(key)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(each)}" for key, each in value.items()) + " }"
    return "[" + ", ".join(map(_value, value)) + "]"


def _text(text: str) -> str:
    """Return a text in quotes. The escapes of JSON are also escapes of TOML, except for the delete character and surrogates."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")
