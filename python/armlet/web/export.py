"""Export of a closed loop as one HTML page that runs the loop in the browser."""

from __future__ import annotations

import json
import math
import re
import struct
from base64 import b64encode
from collections.abc import Mapping
from html import escape
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias, cast

from numpy.typing import ArrayLike

from .. import _core
from ..arguments import choice, file_path, instance, one_line, shown, text
from ..border import border
from ..errors import InputError
from ..files import write_whole
from ..run.named_numbers import START
from ..run.options import LoopOptions
from ..scenario import Scenario
from .controls import Control, controls_of, stacked
from .drawing import drawing

__all__ = ["export_web", "page_data"]

#: Monitors on a page: name, label and unit. Other monitors are not drawn.
IDENTITIES = {
    "energy": ("energy", "J"),
    "energy_balance": ("energy balance", "J"),
    "lyapunov": ("Lyapunov function", "J"),
    "lyapunov_balance": ("Lyapunov balance", "J"),
    "passivity": ("passivity", "J"),
    "error_1": ("error of level 1", "m, rad"),
    "error_2": ("error of level 2", "m, rad"),
    "error_3": ("error of level 3", "m, rad"),
}

#: Methods with fixed explicit steps.
METHODS = ("rk4", "euler", "semi_implicit")
#: Options of a run that a page uses, and options that it refuses.
USED = ("v0", "theta0", "theta_dot0", "dt", "method", "sample_time", "tau_max", "force", "force_frame")

LoopOf: TypeAlias = Scenario | tuple[_core.Plant, _core.Law]


@border
def export_web(
    loop: LoopOf,
    path: str | PathLike[str],
    controls: Mapping[str, tuple[float, float]] | None = None,
    *,
    q0: ArrayLike | None = None,
    v0: ArrayLike | None = None,
    theta0: ArrayLike | None = None,
    theta_dot0: ArrayLike | None = None,
    dt: float | None = None,
    method: str | None = None,
    sample_time: float | None = None,
    tau_max: ArrayLike | None = None,
    force: ArrayLike | None = None,
    force_frame: str | None = None,
    title: str | None = None,
) -> Path:
    """Write a web page that runs a closed loop in the browser. The page is one HTML file without network.

    The page shows the arm, curves of the last 10 s, and a slider for each control. The loop is WebAssembly with the step `x_next = step(x,
    u, dt)` of `simulate`. Its numbers have the bits of a run with the instruction set `baseline`. Constant targets of the law can be
    dragged. `Quintic`, `BangBang` and `Sinusoid` are the other motions that a page can have.

    Args:
        loop: a `Scenario`, or a pair `(plant, law)`.
        path: path of the page. An existing file is replaced.
        controls: a range (low, high) for each number with a slider, by name. The names are those of `simulate(sensitivity=)`, such as
            "law.kp", "arm.parameters[0]" or "q0[1]". A name without an index requires equal entries. A slider has 101 positions.
        q0: initial position, (n,), rad or m. Required for a pair, optional for a scenario.
        dt: step, s; None: the step of the scenario, the sample time, or 1e-3.
        method: "rk4", "euler" or "semi_implicit"; None: the method of the scenario, or "rk4".
        sample_time: sample period of the law, s; None: continuous law.

    Other Args:
        v0, theta0, theta_dot0: as for `simulate`.
        tau_max: limits of the input, as for `simulate`.
        force: constant external force, (3,), N, or wrench (6,), as for `simulate`. The page has a slider for each of its numbers.
        force_frame: frame at which the force acts; None: the frame of the law.
        title: title of the page; None: the title of the scenario, or the names of law and plant.

    Returns:
        The path of the page.

    Raises:
        InputError: an argument is not valid, or a part of the loop has no WebAssembly. Such parts are laws in Python, laws of task priority
            with limits, and other motions and methods. Forces that vary, and samples with jitter, noise or torque sensors have none
            either.
        OSError: the file cannot be written.

    Source: docs/web.md.

    >>> import armlet as al, tempfile
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> law = al.PDGravity(arm, [0.4, 0.9], kp=20.0, kd=2.0)
    >>> page = al.export_web((al.RigidArm(arm), law), tempfile.mkdtemp() + "/arm.html", {"law.kp": (5.0, 50.0)}, q0=[0.0, 0.0])
    >>> page.read_text().startswith("<!doctype html>")
    True
    """
    target = file_path("export_web", path)
    given = {
        "q0": q0, "v0": v0, "theta0": theta0, "theta_dot0": theta_dot0, "dt": dt, "method": method, "sample_time": sample_time,
        "tau_max": tau_max, "force": force, "force_frame": force_frame,
    }  # fmt: skip
    plant, law, options, name = _parts(loop, given)
    data = page_data(plant, law, controls, options)
    loop_name = f"{type(law).__name__} on {type(plant).__name__}"
    data["title"] = one_line(name or loop_name if title is None else text("export_web", "title", title))
    if data["title"] != loop_name:
        data["about"] = f"{loop_name}, {data['about']}"
    page = document(data)
    write_whole(target, lambda file: file.write(page.encode()))
    return Path(target)


def _parts(loop: LoopOf, given: Mapping[str, Any]) -> tuple[_core.Plant, _core.Law, dict[str, Any], str | None]:
    """Return the plant, the law, the options of the run, and the title of a scenario."""
    own = {name: value for name, value in given.items() if value is not None}
    if isinstance(loop, Scenario):
        built = loop.build()
        options = {name: value for name, value in built.arguments.items() if name in ("q0", *USED)}
        plant, law, title = built.plant, built.law, loop.data.get("title")
    else:
        if not isinstance(loop, tuple | list) or len(loop) != 2:
            raise InputError(f"export_web: loop is of the wrong type: expected a Scenario or a pair (plant, law), got {shown(loop)}")
        (plant, law), options, title = loop, {}, None
    instance("export_web", "plant", plant, _core.Plant, "a plant such as RigidArm")
    if not isinstance(law, _core.Law):
        what = "a function in Python, which a browser cannot run" if callable(law) else shown(law)
        raise InputError(f"export_web: law is of the wrong type: expected a law of armlet such as Adaptive, got {what}")
    options |= own
    if options.get("q0") is None:
        raise InputError("export_web: q0 is missing: expected the initial position (n,), got None")
    options.setdefault("method", "rk4")
    choice("export_web", "method", options["method"], METHODS)
    if options.get("dt") is None and options.get("sample_time") is None:
        options["dt"] = 1e-3
    return plant, law, options, title


def page_data(
    plant: _core.Plant, law: _core.Law, controls: Mapping[str, tuple[float, float]] | None, options: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the data of a page without its title. Arrays of numbers and the module are base64 texts."""
    n = plant.arm.n
    start = {name: _row(name, options[name], n) for name in START if options.get(name) is not None}
    chosen = controls_of(plant, law, start, controls)
    coordinates = _coordinates(law)
    picture = drawing(plant.arm, [frame for frame, _ in coordinates if frame is not None])
    plants, laws, starts = stacked((plant, law, start), chosen)
    q0 = starts.pop("q0")
    assert q0 is not None
    used = {name: value for name, value in options.items() if name not in START} | starts
    used |= {"t_end": 1.0, "record_every": 1, "monitors": True}
    positions = [len(control.loops) for control in chosen]
    made = _core._web_loop(plants, laws, q0, positions, picture["frames"], cast(LoopOptions, used))
    for control, (slots, _) in zip(chosen, made["controls"], strict=True):
        if not slots:
            problem = "expected a number on which it depends"
            raise InputError(f"export_web: controls[{shown(control.name)}] has no effect on the loop: {problem}, got {control.name}")
    labels = [control.label for control in chosen]
    return {
        "wasm": b64encode(made["module"]).decode(),
        "frame": _packed(made["frame"].tolist()),
        **{name: made[name] for name in ("groups", "instants", "dt", "period", "motions")},
        "sampling": _sampling(made["sampling"]),
        "monitors": [_monitor(name, coordinates) for name in made["monitors"]],
        "controls": [
            _described(control, control.label if labels.count(control.label) == 1 else "", *columns)
            for control, columns in zip(chosen, made["controls"], strict=True)
        ],
        "joints": [{"name": name, "unit": _unit(kind)} for name, kind in zip(plant.arm.joint_names, plant.arm.joint_types, strict=True)],
        "input": "force" if made["has_speeds"] else "velocity",
        "picture": picture,
        "desired": coordinates == [(None, [])] and [motion["dof"] for motion in made["motions"]] == [n],
        "targets": _targets(coordinates, n, made["motions"], picture, plant.arm),
        "priority": "tasks" in law.__getnewargs_ex__()[1],
        "about": f"{n} joint{'s' if n > 1 else ''}, {options['method']}, step {made['dt']:g} s",
    }


def _sampling(made: tuple[float, int, int, float, list[float]] | None) -> dict[str, Any] | None:
    """Describe a sampled controller that does more than hold the output: the period, s, the delay in steps, the sensor delay in samples."""
    if made is None:
        return None
    period, delay, sensor_delay, rate_limit, resolution = made
    limit = rate_limit if math.isfinite(rate_limit) else None
    return {"period": period, "delay": delay, "sensor_delay": sensor_delay, "rate_limit": limit, "resolution": list(resolution)}


def _row(name: str, value: Any, n: int) -> Any:
    row = _core.numbers("export_web", name, value)
    if row.shape != (n,):
        raise InputError(f"export_web: {name} has the wrong shape: expected ({n},), got {row.shape}")
    return row


def _unit(kind: str) -> str:
    return "m" if kind == "prismatic" else "rad"


def _packed(values: list[float]) -> str:
    return b64encode(struct.pack(f"<{len(values)}d", *values)).decode()


def _described(control: Control, label: str, slots: list[int], values: list[float]) -> dict[str, Any]:
    return {
        "name": control.name, "label": label, "unit": control.unit, "position": control.position, "values": control.values.tolist(),
        "slots": slots, "numbers": _packed(values),
    }  # fmt: skip


def _coordinates(law: Any) -> list[tuple[str | None, list[str]]]:
    """The frame and the axes of each target of a law; None and no axes for a target of the joints, or of another kind."""
    arguments = law.__getnewargs_ex__()[1]
    # A level is a task, or a list of tasks and of pairs of a task and its weight.
    levels = [level if isinstance(level, list) else [level] for level in arguments.get("tasks", ())]
    tasks = [each[0] if isinstance(each, tuple) else each for level in levels for each in level]
    return [_frame_and_axes(task.__getnewargs_ex__()[1]) for task in tasks] or [_frame_and_axes(arguments)]


def _monitor(name: str, coordinates: list[tuple[str | None, list[str]]]) -> tuple[str, str] | None:
    """The label and the unit of a monitor; None if it is not drawn."""
    known = IDENTITIES.get(name)
    is_position = all(axes and set(axes) <= set("xyz") for _, axes in coordinates)
    return (known[0], "m") if known and known[1] == "m, rad" and is_position else known


def _frame_and_axes(part: Mapping[str, Any]) -> tuple[str | None, list[str]]:
    axes = part.get("axes", "xyz")
    if "frame" not in part or not isinstance(axes, str | None):
        return None, []
    return part["frame"], re.findall("r?[xyz]", axes or "xyz")


def _targets(
    coordinates: list[tuple[str | None, list[str]]], n: int, motions: list[dict[str, Any]], picture: dict[str, Any], arm: Any
) -> list[dict[str, Any]]:
    """Describe the constant targets that can be dragged. `first` is the place of a target among the numbers of all motions."""
    targets: list[dict[str, Any]] = []
    first = 0
    for (frame, axes), motion in zip(coordinates, motions, strict=False):
        if motion["breaks"] is None and frame is None and motion["dof"] == n:
            targets.append({"kind": "joints", "first": first})
        elif motion["breaks"] is None and frame is not None and motion["dof"] == len(axes):
            drawn = picture["frames"].index(arm.frame_names.index(frame))
            targets.append({"kind": "frame", "first": first, "axes": axes, "frame": drawn, "name": frame})
        first += 3 * motion["dof"]
    return targets


def document(data: Mapping[str, Any]) -> str:
    """Return the page with this data."""
    here = files(__package__)
    style, *programs = (here.joinpath(name).read_text(encoding="utf-8") for name in ("page.css", "loop.js", "picture.js", "page.js"))
    # A closing tag within a string would end the script.
    content = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    title = escape(str(data["title"]))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>\n{style}</style></head><body>\n<main></main>\n"
        f'<noscript>This page needs JavaScript.</noscript>\n<script id="data" type="application/json">{content}</script>\n'
        + "".join(f"<script>\n{program}</script>\n" for program in programs)
        + "</body></html>\n"
    )
