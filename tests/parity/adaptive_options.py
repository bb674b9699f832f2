"""Make the same adaptive law with armlet and with the reference, for options that several tests share."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

import armlet as al
from armlet import reference as ref


def columns_beside(n: int, keywords: dict[str, Any]) -> int:
    """Return the number of parameters of joints (friction, armature, offset) that follow the inertial parameters."""
    kinds = keywords.get("friction", ())
    return int(n * ((2 if kinds is True else len(kinds)) + keywords.get("armature", False) + keywords.get("offset", False)))


def parametrisation(option: str, arms: tuple[Any, Any], bodies: NDArray[Any]) -> tuple[dict[str, Any], dict[str, Any], int]:
    """Return the keywords for armlet's law and for the reference's law, and the number of inertial parameters.

    `option` is "base", "projection", "natural" or another name without keywords. `bodies` (10 n,) are the inertial parameters.
    """
    arm, theirs = arms
    if option == "base":
        base = arm.base_parameters()
        return {"base": base}, {"base": ref.base_parameters(theirs)}, base.count
    named: dict[str, dict[str, Any]] = {"projection": {"projection": 0.3 * bodies}, "natural": {"natural": True}}
    shared = named.get(option, {})
    return shared, shared, bodies.size


def laws(arms: tuple[Any, Any], motion: NDArray[Any], gamma: Any, own: dict[str, Any], other: dict[str, Any]) -> tuple[Any, Any]:
    """Return armlet's law with the keywords `own`, and the reference's law with the keywords `other`."""
    arm, theirs = arms
    ours = al.Adaptive(arm, al.Sinusoid(*motion), 30.0, 10.0, gamma, **own)
    return ours, ref.Adaptive(theirs, ref.Sinusoid(*motion), 30.0, 10.0, gamma, **other)
