"""The JSON schema of scenario files, for editors, and templates of scenario files."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

from ..arguments import choice
from ..border import border
from .tables import SCENARIO

__all__ = ["TEMPLATES", "schema", "template"]

TEMPLATES = ("adaptive", "elastic", "mintime", "priority")


@border
def schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a scenario file."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "armlet scenario"}
    return head | SCENARIO.schema()


@border
def template(name: str) -> str:
    """Return the text of a scenario with comments, as a starting point."""
    choice("template", "name", name, TEMPLATES)
    return (files(__package__) / "templates" / f"{name}.toml").read_text(encoding="utf-8")
