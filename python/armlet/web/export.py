"""Export of a closed loop as one HTML page that runs the loop in the browser."""

from __future__ import annotations

import json
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
    title: str | None = None,
) -> Path:
    """Write a web page that runs a closed loop in the browser. The page is one HTML file without network.

    The page shows the arm, curves of the last 10 s, and a slider for each control. The loop is WebAssembly with the step `x_next = step(x,
    u, dt)` of `simulate`. Its numbers have the bits of a run with the instruction set `baseline`. If the target of the law is constant,
    it can be dragged. `Quintic`, `BangBang` and `Sinusoid` are the other motions that a page can have.

    Args:
        loop: a `Scenario`, or a pair `(plant, law)`.
        path: path of the page. An existing file is replaced.
        controls: a range (low, high) for each number with a slider, by name. The names are those of `simulate(sensitivity=)`, such as
            "law.kp", "arm.parameters[0]" or "q0[1]". A name without an index requires equal entries. A slider has 101 positions.
        q0: initial position, (n,), rad or m. Required for a pair, optional for a scenario.
        v0, theta0, theta_dot0: as for `simulate`.
        dt: step, s; None: the step of the scenario, the sample time, or 1e-3.
        method: "rk4", "euler" or "semi_implicit"; None: the method of the scenario, or "rk4".
        sample_time: sample period of the law, s; None: continuous law.
        tau_max: limits of the input, as for `simulate`.
        title: title of the page; None: the title of the scenario, or the names of law and plant.

    Returns:
        The path of the page.

    Raises:
        InputError: an argument is not valid, or a part of the loop has no WebAssembly. Such parts are laws in Python, laws with decisions
            in native code, other motions and methods, forces, stick-slip friction, and samples with delays or noise.
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
        "tau_max": tau_max,
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
    frame, _ = _coordinates(law)
    picture = drawing(plant.arm, frame)
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
    return {
        "wasm": b64encode(made["module"]).decode(),
        "frame": _packed(made["frame"].tolist()),
        **{name: made[name] for name in ("groups", "instants", "dt", "period", "motions")},
        "monitors": [IDENTITIES.get(name) for name in made["monitors"]],
        "controls": [_described(control, *columns) for control, columns in zip(chosen, made["controls"], strict=True)],
        "joints": [{"name": name, "unit": _unit(kind)} for name, kind in zip(plant.arm.joint_names, plant.arm.joint_types, strict=True)],
        "input": "force" if made["has_speeds"] else "velocity",
        "picture": picture,
        "desired": frame is None and [motion["dof"] for motion in made["motions"]] == [n],
        "target": _target(law, n, made["motions"], picture, plant.arm),
        "about": f"{n} joints, {options['method']}, step {made['dt']:g} s",
    }


def _row(name: str, value: Any, n: int) -> Any:
    row = _core.numbers("export_web", name, value)
    if row.shape != (n,):
        raise InputError(f"export_web: {name} has the wrong shape: expected ({n},), got {row.shape}")
    return row


def _unit(kind: str) -> str:
    return "m" if kind == "prismatic" else "rad"


def _packed(values: list[float]) -> str:
    return b64encode(struct.pack(f"<{len(values)}d", *values)).decode()


def _described(control: Control, slots: list[int], values: list[float]) -> dict[str, Any]:
    return {
        "name": control.name, "unit": control.unit, "position": control.position, "values": control.values.tolist(), "slots": slots,
        "numbers": _packed(values),
    }  # fmt: skip


def _coordinates(law: Any) -> tuple[str | None, list[str]]:
    """The frame and the axes of the target of a law; None and no axes for a target of the joints."""
    arguments = law.__getnewargs_ex__()[1]
    axes = arguments.get("axes", "xyz")
    if "frame" not in arguments or not isinstance(axes, str | None):
        return None, []
    return arguments["frame"], re.findall("r?[xyz]", axes or "xyz")


def _target(law: Any, n: int, motions: list[dict[str, Any]], picture: dict[str, Any], arm: Any) -> dict[str, Any] | None:
    """Describe a constant target that can be dragged. None: there is no such target."""
    frame, axes = _coordinates(law)
    if not motions or motions[0]["breaks"] is not None:
        return None
    if frame is None:
        return {"kind": "joints"} if motions[0]["dof"] == n else None
    if len(axes) != motions[0]["dof"]:
        return None
    return {"kind": "frame", "axes": axes, "frame": picture["frames"].index(arm.frame_names.index(frame))}


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
