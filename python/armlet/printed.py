"""Export laws, observers and functions of arms as C99 that runs without armlet: headers, sources and CMake files."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from .arguments import file_path, instance, require_partner, shown
from .border import border
from .errors import InputError
from .files import folder_for, open_regular, write_whole

__all__ = ["export_c"]

#: Functions of an arm that are exported by default.
DYNAMICS = ("mass_matrix", "coriolis_matrix", "gravity", "bias", "inverse_dynamics", "forward_dynamics")
#: Functions that depend on a frame.
FRAMED = ("pose", "pose_vector", "position", "jacobian", "jacobian_dot")
#: Functions that accept a wrench at a frame.
LOADED = ("inverse_dynamics", "forward_dynamics")
#: Functions with the argument `friction`.
RUBBING = ("bias", "regressor", *(f"{way}_dynamics{what}" for way in ("inverse", "forward") for what in ("", "_derivatives")))
#: Beginnings of the first lines of files that armlet writes.
STAMPS = ("/* Made by armlet ", "# Made by armlet ")

Function: TypeAlias = str | tuple[str, str]


@border
def export_c(
    law: _core.Law | _core.Arm | _core.MomentumObserver,
    folder: str | PathLike[str],
    *,
    functions: Sequence[Function] | None = None,
    prefix: str | None = None,
    dt: float | None = None,
    method: str = "rk4",
    sample_time: float | None = None,
    tau_max: ArrayLike | None = None,
    friction: bool = False,
    armature: bool = False,
    fused: bool | None = None,
    overwrite: bool = False,
) -> list[Path]:
    """Write a law, an observer, or functions of an arm as C99: a header, a source file and a `CMakeLists.txt`.

    The C code does not need armlet. It allocates nothing, does not recurse, and includes only `math.h` and `string.h`. Its results equal
    armlet's on this machine, bit by bit, if it is compiled with `-ffp-contract=off`, as its CMake file does. A law becomes
    `<prefix>_init(state)` and `<prefix>_step(state, t, q, v, tau)`, with `theta, theta_dot` before `tau` for laws of elastic arms. The C
    code contains the desired motion. A function of an arm becomes `<prefix>_<name>(inputs.., out)`, with row-major matrices. A
    `MomentumObserver` becomes `<prefix>_init(state)`, `<prefix>_update(state, q, v, tau, dt, residual)`, and, if it has thresholds,
    `<prefix>_contact(state)`, which returns the index of the joint in contact or -1. `_step`, `_update` and functions of an arm return 0,
    or a status that the header lists. After an error `tau` is the last valid output, and `out` is NaN.

    Args:
        law: a law, a `MomentumObserver` or an arm.
        folder: folder of the files. It is created if it does not exist.
        functions: functions of an arm: names of `Arm`'s methods such as "mass_matrix", or `(name, frame)`. The default frame is
            `arm.tip_frame`. `("inverse_dynamics", frame)` and `("forward_dynamics", frame)` accept a wrench `[f; m]` at the frame, N and
            N m. None: the equations of motion.
        prefix: first part of all names in C, and name of the files and of the CMake target; None: "law", "observer" or "arm".
        dt: step of the sampled loop, s, for a law with a state (an estimate, an integral). Calls at multiples of `dt` advance the state
            to the same bits as `simulate(.., dt=dt, sample_time=..)`. None: each call advances the state by one step, whose length is the
            time since the previous call.

    Other Args:
        method: integration method of the law's state: "rk4", "euler" or "semi_implicit", as for `simulate`. Only for laws with a state.
        sample_time: time between calls, s, of a `Guarded` law, whose observer depends on it, and of a law with limits that has no
            `horizon`. None: `dt`.
        tau_max: limits of the torque (or velocity), as for `simulate`: a number > 0 or (n,). None: no limits. The observer of a `Guarded`
            law receives limited torques.
        friction: whether functions of an arm include friction, as with the argument `friction` of the methods of `Arm`. At least one of the
            functions must have this argument.
        armature: whether the regressor has columns of armature. `functions` must have the regressor.
        fused: whether a product and a sum are one operation `fma`. None: as armlet does on this machine. Only None guarantees equal bits.
        overwrite: overwrite files with these names that armlet did not write.

    Returns:
        The paths of the files, in the order header, source, `CMakeLists.txt`.

    Raises:
        InputError: the law is a Python function or has scaled commands, or a function or a frame is unknown. It is also raised if a
            file exists that armlet did not write, or if another argument is not valid.
        OSError: a file cannot be written.

    Source: docs/export_c.md.

    >>> import armlet as al, tempfile
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> law = al.PDGravity(arm, [0.4, 0.9], kp=80.0, kd=16.0)
    >>> [file.name for file in al.export_c(law, tempfile.mkdtemp())]
    ['law.h', 'law.c', 'CMakeLists.txt']
    >>> header, *_ = al.export_c(arm, tempfile.mkdtemp(), functions=["gravity", ("jacobian", "link2")])
    >>> print(*[line for line in header.read_text().splitlines() if line.startswith("int")], sep="\\n")
    int arm_gravity(const double q[2], double out[2]);
    int arm_jacobian_link2(const double q[2], double out[12]);
    """
    where = Path(file_path("export_c", folder, "folder"))
    instance("export_c", "overwrite", overwrite, (bool, np.bool_), "True or False")
    of_law: dict[str, object] = {"dt": dt, "method": None if _is_default(method) else method, "sample_time": sample_time}
    of_law["tau_max"] = tau_max
    of_arm: dict[str, object] = {"functions": functions, "friction": friction, "armature": armature}
    if isinstance(law, _core.Arm):
        _require_unused("an arm", of_law)
        named = _named(law, DYNAMICS if functions is None else functions)
        methods = {method for _, method, _ in named}
        require_partner("export_c", "friction", friction, " or ".join(RUBBING), bool(methods.intersection(RUBBING)), False)
        require_partner("export_c", "armature", armature, "the function regressor", "regressor" in methods, False)
        files = _core._c_of_arm(law, named, "arm" if prefix is None else prefix, fused, friction, armature)
    elif isinstance(law, _core.MomentumObserver):
        _require_unused("an observer", of_law | of_arm)
        files = _core._c_of_observer(law, "observer" if prefix is None else prefix, fused)
    else:
        if not isinstance(law, _core.Law):
            what = "a function in Python, which has no C" if callable(law) else shown(law)
            raise InputError(f"export_c: law cannot be exported: expected an arm or a law of armlet such as Adaptive, got {what}")
        _require_unused("a law", of_arm)
        files = _core._c_of_law(law, "law" if prefix is None else prefix, fused, dt, method, sample_time, tau_max)
    paths = [where / name for name, _ in files]
    if not overwrite:
        for path in paths:
            _require_own(path)
    folder_for(where)
    for path, (_, text) in zip(paths, files, strict=True):
        write_whole(path, lambda file, text=text: file.write(text.encode()))  # type: ignore[misc]
    return paths


def _is_default(method: object) -> bool:
    return isinstance(method, str) and method == "rk4"


def _require_unused(of: str, arguments: Mapping[str, object]) -> None:
    """Raise an InputError if one of `arguments` is set, because they have no effect for an object of the kind `of`."""
    for name, value in arguments.items():
        if value is not None and value is not False:
            raise InputError(f"export_c: {name} is not used: expected none for {of}, got {shown(value)}")


def _named(arm: _core.Arm, functions: Sequence[Function]) -> list[tuple[str, str, str | None]]:
    """For each function: its name in C without the prefix, the name of the method of `Arm`, and the frame or None."""
    if isinstance(functions, str) or not isinstance(functions, Sequence) or not len(functions):
        raise InputError(f"export_c: functions is not a list of names: expected a list such as ['mass_matrix'], got {shown(functions)}")
    named: list[tuple[str, str, str | None]] = []
    for k, function in enumerate(functions):
        name, frame = (function, None) if isinstance(function, str) else _pair(function, k)
        if frame is None:
            named.append((name, name, arm.tip_frame if name in FRAMED else None))
        else:
            if name not in (*FRAMED, *LOADED):
                raise InputError(f"export_c: functions has a frame for {name}: expected none, got {shown(frame)} (first bad index {k})")
            named.append((f"{name}_{re.sub(r'[^A-Za-z0-9]', '_', frame)}", name, frame))
    names = [name for name, *_ in named]
    for k, name in enumerate(names):
        if name in names[:k]:
            raise InputError(f"export_c: functions has {name} twice: expected different names in C (first bad index {k})")
    return named


def _pair(function: object, k: int) -> tuple[str, str]:
    if isinstance(function, tuple | list) and len(function) == 2 and all(isinstance(part, str) for part in function):
        return function[0], function[1]
    raise InputError(
        f"export_c: functions has an entry that is no name: expected a name or (name, frame), got {shown(function)} (first bad index {k})"
    )


def _require_own(path: Path) -> None:
    """Refuse to overwrite a file that armlet did not write."""
    try:
        with open_regular(path) as file:
            start = file.read(max(map(len, STAMPS)))
    except FileNotFoundError:
        return
    if not start.startswith(tuple(stamp.encode() for stamp in STAMPS)):
        problem = f"expected overwrite=True to replace it, got {shown(str(path))}"
        raise InputError(f"export_c: folder holds a file that armlet did not make: {problem}")
