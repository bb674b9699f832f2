"""Positional arguments beyond the last positional one: the message names the arguments that a call must write by name."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import models
import pytest

import armlet as al
from armlet import gym

ARM = models.TWO_LINKS
LAW = al.PDGravity(ARM, [0.1, 0.2], 20.0, 5.0)


def test_an_initial_velocity_without_its_name() -> None:
    with pytest.raises(
        TypeError, match=r"^simulate: expected at most 3 arguments without a name, got 4: write the others by name: "
    ) as fault:
        al.simulate(al.RigidArm(ARM), LAW, [0.0, 0.0], [0.0, 0.0], t_end=1.0)  # type: ignore[misc]
    assert "v0=" in str(fault.value) and "t_end=" in str(fault.value)


def functions() -> dict[str, tuple[Callable[..., Any], int, list[str]]]:
    """The public functions, methods and constructors of Python with keyword-only arguments: the callable, and its arguments by kind."""
    found: dict[str, tuple[Callable[..., Any], int, list[str]]] = {}
    for module in (al, gym):
        for name in module.__all__:
            thing = getattr(module, name)
            candidates = {name: thing.__init__ if inspect.isclass(thing) else thing}
            if inspect.isclass(thing):
                candidates |= {f"{name}.{key}": value for key, value in vars(thing).items() if not key.startswith("_")}
            for key, function in candidates.items():
                if not inspect.isfunction(function):
                    continue
                parameters = inspect.signature(function).parameters.values()
                only = [each.name for each in parameters if each.kind is each.KEYWORD_ONLY]
                if only and not any(each.kind is each.VAR_POSITIONAL for each in parameters):
                    found[f"{module.__name__}.{key}"] = (
                        function,
                        len(parameters) - len(only) - any(e.kind is e.VAR_KEYWORD for e in parameters),
                        only,
                    )
    return found


def test_all_functions_of_python_name_their_keyword_arguments() -> None:
    checked = functions()
    assert len(checked) > 25 and "armlet.simulate_batch" in checked and "armlet.Sampling" in checked
    for name, (function, most, only) in checked.items():
        with pytest.raises(TypeError) as fault:
            function(*[None] * (most + 1))
        assert all(f"{each}=" in str(fault.value) for each in only), f"{name}: {fault.value}"
        assert str(fault.value).startswith(name.split(".", 1)[1].removeprefix("gym.") + ": expected at most"), fault.value


#: For each call of the extension: the function, and the number of its positional arguments.
EXTENSION: dict[str, tuple[Callable[..., Any], int]] = {
    "inverse_kinematics": (al.inverse_kinematics, 3),
    "time_path": (al.time_path, 2),
    "load_urdf": (al.load_urdf, 1),
    "planar_arm": (al.planar_arm, 1),
    "solve_priority": (al.solve_priority, 2),
    "bang_bang_time": (al.bang_bang_time, 5),
    "PID": (al.PID, 6),
    "Task": (al.Task, 4),
    "RelativeTask": (al.RelativeTask, 5),
    "Adaptive": (al.Adaptive, 5),
    "RigidArm": (al.RigidArm, 1),
    "Wall": (al.Wall, 3),
    "Table": (al.Table, 4),
    "Spline": (al.Spline, 4),
    "Table.at": (al.Table.at, 4),
    "Arm.with_drives": (ARM.with_drives, 0),
    "Arm.pose": (ARM.pose, 2),
    "Arm.mass_matrix": (ARM.mass_matrix, 1),
    "Arm.from_chain": (al.Arm.from_chain, 1),
    "PrioritySolver.for_arm": (al.PrioritySolver.for_arm, 2),
}


@pytest.mark.parametrize("name", EXTENSION)
def test_functions_of_the_extension_name_their_keyword_arguments(name: str) -> None:
    function, most = EXTENSION[name]
    only = [each.name for each in inspect.signature(function).parameters.values() if each.kind is each.KEYWORD_ONLY]
    required = [
        each.name
        for each in inspect.signature(function).parameters.values()
        if each.kind is each.KEYWORD_ONLY and each.default is each.empty
    ]
    with pytest.raises(TypeError) as fault:
        function(*[None] * (most + 1), **dict.fromkeys(required))
    names = ", ".join(f"{each}=" for each in only)
    arguments = f"expected at most {most} arguments without a name, got {most + 1}"
    assert str(fault.value) == f"{name}: {arguments}: write the others by name: {names}" and only
