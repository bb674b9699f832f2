"""Scenario files: arm, plant, motion, law and run as one TOML file, checked key by key."""

from .built import Built
from .scenario import Scenario
from .schema import TEMPLATES, schema, template

__all__ = ["TEMPLATES", "Built", "Scenario", "schema", "template"]
