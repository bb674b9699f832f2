"""Adaptive laws of the core and of the reference with the same options."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

import armlet as al
from armlet import reference as ref


def columns_beside(n: int, keywords: dict[str, Any]) -> int:
    """How many columns of joints stand behind the inertial ones."""
    kinds = keywords.get("friction", ())
    return int(n * ((2 if kinds is True else len(kinds)) + keywords.get("armature", False)))


def parametrisation(option: str, arms: tuple[Any, Any], bodies: NDArray[Any]) -> tuple[dict[str, Any], dict[str, Any], int]:
    """Keywords of the core's law and of the reference's for "base", "projection" and "natural"; how many inertial parameters there are."""
    arm, theirs = arms
    if option == "base":
        base = arm.base_parameters()
        return {"base": base}, {"base": ref.base_parameters(theirs)}, base.count
    named: dict[str, dict[str, Any]] = {"projection": {"projection": 0.3 * bodies}, "natural": {"natural": True}}
    shared = named.get(option, {})
    return shared, shared, bodies.size


def laws(arms: tuple[Any, Any], motion: NDArray[Any], gamma: Any, own: dict[str, Any], other: dict[str, Any]) -> tuple[Any, Any]:
    """The law of the core with keywords of its own, and that of the reference."""
    arm, theirs = arms
    ours = al.Adaptive(arm, al.Sinusoid(*motion), 30.0, 10.0, gamma, **own)
    return ours, ref.Adaptive(theirs, ref.Sinusoid(*motion), 30.0, 10.0, gamma, **other)
