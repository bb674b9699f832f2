"""Runs on disk: an npz container with a JSON header and a SHA-256 over all of it. No pickle, whole or not at all.

The header is the member `header` (UTF-8 bytes): format, version, kind, law, units, status, scalar stats, sha256. The other
members are the arrays by name; monitors, limits, array stats and events as `monitors/name`, `limits/name`, `stats/name`,
`events/name`, the desired motion as `q_d v_d a_d`. Polynomials of a dense run are not kept. The comment at the end of the archive
is the SHA-256 of all bytes before it, so that damage is noticed before anything is read.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .arguments import file_path
from .border import border
from .errors import FormatError
from .events import Events
from .run import SERIES, BatchRun, Run
from .status import Status

if TYPE_CHECKING:
    from .run import _Recorded

__all__ = ["digest", "load", "pack", "save", "unpack", "write_whole"]

FORMAT = "armlet run"
VERSION = 1
SINGLE = ("parameters", "target", "position_error")
DESIRED = ("q_d", "v_d", "a_d")
SEAL = b"sha256:"
SEALED = len(SEAL) + 64  # bytes of the comment
EVENTS = ("t", "which", "q", "v", "theta", "theta_dot")


def digest(header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> str:
    """SHA-256 of the header (without its digest) and of every array with its name, type and shape."""
    state = hashlib.sha256(json.dumps({k: v for k, v in header.items() if k != "sha256"}, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        state.update(f"\0{name}\0{array.dtype.str}\0{array.shape}\0".encode())
        state.update(array.tobytes())
    return state.hexdigest()


def pack(file: IO[bytes], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write the arrays as an npz archive whose comment seals it."""
    np.savez(file, allow_pickle=False, **arrays)
    # The last two bytes of an archive without a comment are the length of the comment.
    file.seek(-2, os.SEEK_END)
    file.write(SEALED.to_bytes(2, "little"))
    file.write(SEAL + _digest_of(file, file.tell()))


def unpack(file: IO[bytes]) -> tuple[dict[str, NDArray[Any]], bool]:
    """The arrays of an archive, and whether it carries a seal; FormatError where the seal is broken or the archive can't be read."""
    end = file.seek(0, os.SEEK_END)
    start = max(end - SEALED, 0)
    file.seek(start)
    tail = file.read(SEALED)
    sealed = tail.startswith(SEAL)
    if sealed and tail[len(SEAL) :] != _digest_of(file, start):
        raise FormatError("is damaged: its checksum does not match")
    file.seek(0)
    try:
        with np.load(file, allow_pickle=False) as container:
            return {key: container[key] for key in container.files}, sealed
    # Whatever a damaged archive makes zipfile or numpy stumble over, sizes beyond the memory among it.
    except Exception as error:
        problem = f"is not a run of armlet or is damaged: expected an npz container, got {error or type(error).__name__}"
        raise FormatError(problem) from None


def _digest_of(file: IO[bytes], size: int) -> bytes:
    """SHA-256 of the first `size` bytes, in hexadecimal; the file is left at their end."""
    state = hashlib.sha256()
    file.seek(0)
    while size > 0:
        piece = file.read(min(size, 1 << 20))
        if not piece:
            break
        state.update(piece)
        size -= len(piece)
    return state.hexdigest().encode()


def save(run: _Recorded, path: str | PathLike[str]) -> None:
    """Write `run` to `path`; the file is there whole or not at all, also when the disk is full."""
    items = run._items()
    arrays: dict[str, NDArray[Any]] = {name: items[name] for name in ("t", *SERIES, *SINGLE) if name in items}
    arrays |= {f"monitors/{name}": values for name, values in run.monitors.items()}
    arrays |= {f"stats/{name}": np.asarray(value) for name, value in run.stats.items() if np.ndim(value)}
    arrays |= {f"limits/{name}": values for name, values in items.get("limits", {}).items()}
    if run.events is not None:
        arrays |= {f"events/{name}": getattr(run.events, name) for name in EVENTS if getattr(run.events, name) is not None}
    arrays |= dict(zip(DESIRED, items["desired"], strict=True)) if "desired" in items else {}
    status = items["status"]
    if not isinstance(status, Status):
        arrays["status"] = status
    scalars = {name: value for name, value in run.stats.items() if not np.ndim(value)}
    # Little-endian on every machine, so that the digest is of the values.
    arrays = {name: np.ascontiguousarray(a, dtype=a.dtype.newbyteorder("<")) for name, a in arrays.items()}
    header = {
        "format": FORMAT,
        "version": VERSION,
        "kind": type(run).__name__,
        "law": run.law_name,
        "units": list(run.units),
        "status": int(status) if isinstance(status, Status) else None,
        "stats": {name: value.item() if isinstance(value, np.generic) else value for name, value in scalars.items()},
    }
    if run.events is not None:
        header["events"] = list(run.events.names)
    header["sha256"] = digest(header, arrays)
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)

    write_whole(path, lambda file: pack(file, arrays))


def write_whole(path: str | PathLike[str], write: Callable[[IO[bytes]], object]) -> None:
    """Call `write(file)` on a temporary file beside `path` and rename it to `path`: never half a file, never the old one lost."""
    target = os.path.abspath(file_path("save", path))
    if os.path.exists(target) and not os.path.isfile(target):
        # A renamed file would take the place of a device or a pipe, for everybody.
        raise OSError(errno.EINVAL, "is not a regular file", target)
    try:
        handle, scratch = tempfile.mkstemp(dir=os.path.dirname(target), prefix=".armlet-")
    except OSError as error:
        error.filename = target  # not the temporary file, which nobody asked for
        raise
    try:
        with os.fdopen(handle, "w+b") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(scratch, 0o666 & ~umask)  # a temporary file is private: give the result the usual rights
        os.replace(scratch, target)
    except BaseException as error:
        with suppress(OSError):
            os.unlink(scratch)
        if isinstance(error, OSError):
            error.filename = target  # a full disk does not say which file it cut short
        raise


def folder_for(path: Path) -> Path:
    """Make the folder `path` where it is missing; refuse, before any work, one into which nothing may be written."""
    path.mkdir(parents=True, exist_ok=True)
    if not os.access(path, os.W_OK):
        raise PermissionError(f"{path}: is not writable")
    return path


@border
def load(path: str | PathLike[str]) -> Run | BatchRun:
    """Read a run that `run.save` wrote.

    Raises:
        FormatError: the file is no run of armlet, is damaged or cut short, or was written by a newer version.
        OSError: the file cannot be read.
    """
    name = file_path("load", path)

    def fault(problem: str) -> FormatError:
        return FormatError(f"load: {name} {problem}")

    try:
        with open(name, "rb") as file:
            arrays, sealed = unpack(file)
    except FormatError as error:
        raise fault(str(error)) from None
    try:
        header = json.loads(arrays.pop("header").tobytes().decode())
        is_run = header["format"] == FORMAT
    except (KeyError, TypeError, ValueError):
        is_run = False
    if not is_run:
        raise fault("is not a run of armlet: expected a header that says so")
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
    fields |= {"units": tuple(header["units"]), "status": arrays.get("status", header["status"])}
    if "events" in header:
        fields["events"] = Events(names=tuple(header["events"]), **group("events/"))
    if DESIRED[0] in arrays:
        fields["desired"] = tuple(arrays[key] for key in DESIRED)
    return (Run if header["kind"] == "Run" else BatchRun)(fields)
