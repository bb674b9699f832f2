"""The folder of a sweep: `sweep.json` identifies the sweep, and files such as `chunk-000012.npz` have finished cells.

The file of a chunk has a SHA-256 checksum of its header and arrays. A chunk whose checksum does not match is computed again. Only the
calling process writes files: it writes to a temporary name and renames the file. So each file is complete or absent, and a killed process
or a full disk does not change finished chunks.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import FormatError, InputError
from ..files import digest, open_regular, pack, unpack, write_whole

__all__ = ["Store"]

# The version is increased when results change in their last digits, so that all chunks of a sweep have the bits of one release.
FORMAT, VERSION = "armlet sweep", 6
Columns = dict[str, NDArray[Any]]


class Store:
    """Finished chunks of one sweep, in the folder `out`.

    Args:
        out: path of the folder. It is created if it does not exist.
        what: all data that affect the results of the cells. If the folder has a sweep with other data, an error is raised.
        chunk: number of cells per chunk. A resumed sweep keeps the number of its first call.
    """

    def __init__(self, out: Path, what: Mapping[str, Any], chunk: int) -> None:
        self.out = out
        self.key = hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()
        manifest = out / "sweep.json"
        out.mkdir(parents=True, exist_ok=True)
        if manifest.exists():
            self.chunk = self._same(manifest, what)
        else:
            self.chunk = chunk
            head = {"format": FORMAT, "version": VERSION, "sha256": self.key, "chunk": chunk, "what": what}
            write_whole(manifest, lambda file: file.write(json.dumps(head, indent=1).encode()))

    def _same(self, manifest: Path, what: Mapping[str, Any]) -> int:
        try:
            with open_regular(manifest) as file:
                head = json.loads(file.read())
            known = head["format"] == FORMAT and head["version"] == VERSION
            chunk, held = int(head["chunk"]), head["what"]
        except (ValueError, KeyError, TypeError):
            known = False
        if not known or chunk < 1:
            raise FormatError(f"sweep: {manifest} is damaged or not of this version: expected a file that a sweep of this version wrote")
        if head["sha256"] != self.key:
            other = [name for name in what if json.loads(json.dumps(what[name])) != held.get(name)]
            raise InputError(
                f"sweep: {self.out} holds another sweep: expected an empty folder or the same sweep, got a different {', '.join(other)}"
            )
        return chunk

    def _file(self, start: int) -> Path:
        return self.out / f"chunk-{start // self.chunk:06d}.npz"

    def write(self, start: int, columns: Columns) -> None:
        """Write the file of a finished chunk, whose first cell is `start`."""
        arrays = {name: np.ascontiguousarray(a, dtype=a.dtype.newbyteorder("<")) for name, a in columns.items()}
        header = {"format": FORMAT, "version": VERSION, "sweep": self.key, "start": start, "names": list(arrays)}
        header["sha256"] = digest(header, arrays)
        packed = {f"column{i}": array for i, array in enumerate(arrays.values())}
        packed["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
        write_whole(self._file(start), lambda file: pack(file, packed))

    def read(self, start: int, stop: int) -> Columns | None:
        """Return the columns of the chunk with the cells from `start` to `stop`, or None if its file is absent or damaged."""
        try:
            with open_regular(self._file(start)) as file:
                packed, sealed = unpack(file)
            header = json.loads(packed["header"].tobytes().decode())
            arrays = {name: packed[f"column{i}"] for i, name in enumerate(header["names"])}
            whole = sealed and header["sweep"] == self.key and header["start"] == start and header["sha256"] == digest(header, arrays)
        except (OSError, ValueError, KeyError, TypeError):  # a FormatError is a ValueError
            return None
        return arrays if whole and all(len(array) == stop - start for array in arrays.values()) else None

    def tidy(self) -> None:
        """Remove temporary files of killed processes that are older than 60 s. A younger file may belong to another process."""
        for path in self.out.glob(".armlet-*"):
            with suppress(OSError):
                if time.time() - path.stat().st_mtime > 60:
                    path.unlink()
