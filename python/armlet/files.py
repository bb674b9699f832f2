"""Read regular files only, write files so that no incomplete file remains, and pack arrays in archives with a checksum."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import stat
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from .arguments import file_path
from .errors import FormatError

__all__ = ["digest", "folder_for", "open_regular", "pack", "unpack", "write_whole"]

SEAL = b"sha256:"
SEALED = len(SEAL) + 64  # length of the archive's comment, bytes


def digest(header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> str:
    """SHA-256, in hexadecimal, of the header (without its entry "sha256") and of every array with its name, type and shape."""
    state = hashlib.sha256(json.dumps({k: v for k, v in header.items() if k != "sha256"}, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        state.update(f"\0{name}\0{array.dtype.str}\0{array.shape}\0".encode())
        state.update(array.tobytes())
    return state.hexdigest()


def pack(file: IO[bytes], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write the arrays as an npz archive, with a checksum in the archive's comment."""
    np.savez(file, allow_pickle=False, **arrays)
    # In an archive without a comment, the last two bytes are the comment's length.
    file.seek(-2, os.SEEK_END)
    file.write(SEALED.to_bytes(2, "little"))
    file.write(SEAL + _digest_of(file, file.tell()))


def unpack(file: IO[bytes]) -> tuple[dict[str, NDArray[Any]], bool]:
    """Return the arrays of an archive, and whether it has a checksum.

    Raises:
        FormatError: the checksum is wrong, or the archive cannot be read.
    """
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
    # For a damaged archive, zipfile and numpy can raise various errors, such as MemoryError for a wrong size.
    except Exception as error:
        problem = f"is not a run of armlet or is damaged: expected an npz container, got {error or type(error).__name__}"
        raise FormatError(problem) from None


def _digest_of(file: IO[bytes], size: int) -> bytes:
    """SHA-256, in hexadecimal, of the first `size` bytes. Afterwards the file position is `size`."""
    state = hashlib.sha256()
    file.seek(0)
    while size > 0:
        piece = file.read(min(size, 1 << 20))
        if not piece:
            break
        state.update(piece)
        size -= len(piece)
    return state.hexdigest().encode()


def open_regular(path: str | PathLike[str]) -> IO[bytes]:
    """Open a regular file to read bytes.

    Raises:
        OSError: the file cannot be opened, or is a pipe or a device. Reading of these may wait without end.
    """
    return open(path, "rb", opener=_regular)


def _regular(path: str, flags: int) -> int:
    # With this flag, opening a pipe does not wait for its writer. Windows has no such flag.
    handle = os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
    mode = os.fstat(handle).st_mode
    if stat.S_ISREG(mode) or stat.S_ISDIR(mode):  # for a folder, `open` raises its usual error
        return handle
    os.close(handle)
    raise OSError(errno.EINVAL, "is not a regular file", path)


def write_whole(path: str | PathLike[str], write: Callable[[IO[bytes]], object]) -> None:
    """Call `write(file)` on a temporary file in the folder of `path`, and rename it to `path`. So `path` is never an incomplete file."""
    target = os.path.abspath(file_path("save", path))
    if os.path.exists(target) and not os.path.isfile(target):
        # The rename would replace a device or a pipe by a file.
        raise OSError(errno.EINVAL, "is not a regular file", target)
    try:
        handle, scratch = tempfile.mkstemp(dir=os.path.dirname(target), prefix=".armlet-")
    except OSError as error:
        error.filename = target  # report the target instead of the temporary file
        raise
    try:
        with os.fdopen(handle, "w+b") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(scratch, 0o666 & ~umask)  # a temporary file is private; give the result the usual permissions
        os.replace(scratch, target)
    except BaseException as error:
        with suppress(OSError):
            os.unlink(scratch)
        if isinstance(error, OSError):
            error.filename = target  # an error of a full disk has no file name
        raise


def folder_for(path: Path) -> Path:
    """Make the folder `path` if it does not exist. Refuse a folder without write permission before any work starts."""
    path.mkdir(parents=True, exist_ok=True)
    if not os.access(path, os.W_OK):
        raise PermissionError(f"{path}: is not writable")
    return path
