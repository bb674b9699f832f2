"""The types of run options have the names of the arguments from which they are built."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import pytest

import armlet as al
from armlet.run.options import BatchOptions, ProgramOptions, RunOptions

#: The functions, the types of their options, and the arguments that are no options.
BUILT: list[tuple[Callable[..., Any], Any, set[str]]] = [
    (al.simulate, RunOptions, {"plant", "law", "q0", "sensitivity", "throw"}),
    (al.simulate_batch, BatchOptions, {"plant", "law", "q0", "sensitivity", "progress", "out"}),
]


@pytest.mark.parametrize(("function", "options", "others"), BUILT)
def test_options_have_the_names_of_the_arguments(function: Callable[..., Any], options: Any, others: set[str]) -> None:
    names = set(inspect.signature(function).parameters)
    assert others < names
    assert set(options.__annotations__) == names - others


def test_a_program_has_options_of_a_run_and_its_own() -> None:
    names = set(inspect.signature(al.loop_program).parameters) - {"plant", "law", "stage"}
    assert names <= set(ProgramOptions.__annotations__)
    assert names - set(RunOptions.__annotations__) == {"batch", "part"}


def test_the_simulator_refuses_names_that_are_no_options() -> None:
    arm = al.planar_arm([0.5])
    with pytest.raises(al.InputError, match="unknown: expected some of ") as raised:
        al.Simulator(al.RigidArm(arm), None, [0.0], dt=1e-3, rate=1.0)
    assert set(str(raised.value).partition("some of ")[2].split(", ")) < set(RunOptions.__annotations__)
