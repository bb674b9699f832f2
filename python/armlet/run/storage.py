"""Files of runs: npz archives with a JSON header and SHA-256 checksums, without pickle. A file is complete or absent.

The member `header` of the archive is the JSON header (UTF-8 bytes): format, version, kind, law, units, status, scalar stats, sha256. The
other members are the arrays by name. Monitors, limits, array stats and events have the names `monitors/name`, `limits/name`, `stats/name`,
`events/name`. The desired motion is `q_d`, `v_d`, `a_d`. Derivatives are `sensitivity/k/series`. Polynomials of a dense run are not
stored. The comment at the end of the archive is the SHA-256 of all bytes before it. So `read` finds damage before it reads a member.
"""

from __future__ import annotations

import json
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import file_path
from ..errors import FormatError
from ..files import digest, open_regular, pack, unpack, write_whole
from ..status import Status
from .events import Events
from .recorded import SERIES, Recorded
from .sensitivity import Sensitivity, series_of

__all__ = ["read", "save"]

FORMAT = "armlet run"
VERSION = 1
SINGLE = ("parameters", "target", "position_error", "orientation_error", "contact_force", "residual", "touched", "contact_state")
DESIRED = ("q_d", "v_d", "a_d")
EVENTS = ("t", "which", "q", "v", "theta", "theta_dot")


def save(run: Recorded, path: str | PathLike[str]) -> None:
    """Write `run` to the file `path`. The file is complete or absent, even if the disk becomes full."""
    items = run._items()
    arrays: dict[str, NDArray[Any]] = {name: items[name] for name in ("t", *SERIES, *SINGLE) if name in items}
    arrays |= {f"monitors/{name}": values for name, values in run.monitors.items()}
    arrays |= {f"stats/{name}": np.asarray(value) for name, value in run.stats.items() if np.ndim(value)}
    arrays |= {f"limits/{name}": values for name, values in items.get("limits", {}).items()}
    if run.events is not None:
        arrays |= {f"events/{name}": getattr(run.events, name) for name in EVENTS if getattr(run.events, name) is not None}
    for k, one in enumerate((run.sensitivity or {}).values()):
        arrays |= {f"sensitivity/{k}/{name}": values for name, values in series_of(one).items()}
    arrays |= dict(zip(DESIRED, items["desired"], strict=True)) if "desired" in items else {}
    status = items["status"]
    if not isinstance(status, Status):
        arrays["status"] = status
    scalars = {name: value for name, value in run.stats.items() if not np.ndim(value)}
    # The arrays are little-endian on every machine, so that the checksum depends on the values only.
    arrays = {name: np.ascontiguousarray(a, dtype=a.dtype.newbyteorder("<")) for name, a in arrays.items()}
    header = {
        "format": FORMAT,
        "version": VERSION,
        "kind": type(run).__name__,
        "law": run.law_name,
        "units": list(run.units),
        "input_units": list(run.input_units),
        "status": int(status) if isinstance(status, Status) else None,
        "stats": {name: value.item() if isinstance(value, np.generic) else value for name, value in scalars.items()},
    }
    if run.events is not None:
        header["events"] = list(run.events.names)
    if run.sensitivity:
        header["sensitivity"] = [[one.name, list(one.shape)] for one in run.sensitivity.values()]
    header["sha256"] = digest(header, arrays)
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)

    write_whole(path, lambda file: pack(file, arrays))


def read(path: str | PathLike[str]) -> tuple[str, dict[str, Any]]:
    """Read a file, and return the kind of the stored run, "Run" or "BatchRun", and its fields.

    Raises:
        FormatError: the file is not a run of armlet, is damaged or cut short, or has another format version.
        OSError: the file cannot be read.
    """
    name = file_path("load", path)

    def fault(problem: str) -> FormatError:
        return FormatError(f"load: {name} {problem}")

    try:
        with open_regular(name) as file:
            arrays, sealed = unpack(file)
    except FormatError as error:
        raise fault(str(error)) from None
    try:
        header = json.loads(arrays.pop("header").tobytes().decode())
        is_run = header["format"] == FORMAT
    except (KeyError, TypeError, ValueError):
        is_run = False
    if not is_run:
        raise fault("is not a run of armlet: expected the header of a run")
    if header.get("version") != VERSION:
        raise fault(f"has an unknown version: expected {VERSION}, got {header.get('version')}")
    if header.get("sha256") != digest(header, arrays):
        raise fault("is damaged: its checksum does not match")
    if not sealed:
        raise fault("is damaged: expected a checksum at its end, got none")

    def group(prefix: str) -> dict[str, Any]:
        return {key.removeprefix(prefix): value for key, value in arrays.items() if key.startswith(prefix)}

    fields: dict[str, Any] = {key: arrays[key] for key in ("t", *SERIES, *SINGLE) if key in arrays}
    fields |= {
        "monitors": group("monitors/"),
        "stats": header["stats"] | group("stats/"),
        "law_name": header["law"],
        "limits": group("limits/"),
    }
    # Files of earlier versions have no units of inputs.
    fields |= {"units": header["units"], "input_units": header.get("input_units"), "status": arrays.get("status", header["status"])}
    if "events" in header:
        fields["events"] = Events(names=tuple(header["events"]), **group("events/"))
    if "sensitivity" in header:
        numbered = enumerate(header["sensitivity"])
        ones = [Sensitivity(name, tuple(shape), arrays["t"], **group(f"sensitivity/{k}/")) for k, (name, shape) in numbered]
        fields["sensitivity"] = {one.name: one for one in ones}
    if DESIRED[0] in arrays:
        fields["desired"] = tuple(arrays[key] for key in DESIRED)
    return header["kind"], fields
