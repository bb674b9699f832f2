"""What goes out as text: the scenario's tables as JSON schema for editors, and templates to start from."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

from ..errors import InputError
from .tables import SCENARIO

__all__ = ["TEMPLATES", "schema", "template"]

TEMPLATES = ("adaptive", "elastic", "mintime", "priority")


def schema() -> dict[str, Any]:
    """The JSON schema (draft 2020-12) of a scenario file."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "armlet scenario"}
    return head | SCENARIO.schema()


def template(name: str) -> str:
    """The text of a commented scenario to start from."""
    if name not in TEMPLATES:
        raise InputError(f"template: name is unknown: expected one of {', '.join(TEMPLATES)}, got {name!r}")
    return (files(__package__) / "templates" / f"{name}.toml").read_text(encoding="utf-8")
