"""The folder of a sweep: `sweep.json` identifies the sweep, `chunk-000012.npz` has finished cells. Each file is complete or absent.

A chunk carries a SHA-256 over its header and arrays; a chunk that does not match counts as missing and is computed again. Files are
written by the client alone, to a temporary name and renamed: a kill or a full disk does not change finished chunks.
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
from ..files import digest, pack, unpack, write_whole

__all__ = ["Store"]

# The version rises when results change in their last digits: chunks of one sweep have the bits of one release.
FORMAT, VERSION = "armlet sweep", 4
Columns = dict[str, NDArray[Any]]


class Store:
    """Finished chunks of one sweep, in the folder `out`.

    Args:
        out: the folder; made if it is not there.
        what: everything that affects the cells; a folder of another sweep is refused.
        chunk: cells per chunk; a resumed sweep keeps its first number.
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
            head = json.loads(manifest.read_text(encoding="utf-8"))
            known = head["format"] == FORMAT and head["version"] == VERSION
            chunk, held = int(head["chunk"]), head["what"]
        except (ValueError, KeyError, TypeError):
            known = False
        if not known or chunk < 1:
            raise FormatError(f"sweep: {manifest} is damaged or not of this version: expected the head of a sweep")
        if head["sha256"] != self.key:
            other = [name for name in what if json.loads(json.dumps(what[name])) != held.get(name)]
            raise InputError(
                f"sweep: {self.out} holds another sweep: expected an empty folder or the same sweep, got a different {', '.join(other)}"
            )
        return chunk

    def _file(self, start: int) -> Path:
        return self.out / f"chunk-{start // self.chunk:06d}.npz"

    def write(self, start: int, columns: Columns) -> None:
        """Keep the finished cells from `start` on."""
        arrays = {name: np.ascontiguousarray(a, dtype=a.dtype.newbyteorder("<")) for name, a in columns.items()}
        header = {"format": FORMAT, "version": VERSION, "sweep": self.key, "start": start, "names": list(arrays)}
        header["sha256"] = digest(header, arrays)
        packed = {f"column{i}": array for i, array in enumerate(arrays.values())}
        packed["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
        write_whole(self._file(start), lambda file: pack(file, packed))

    def read(self, start: int, stop: int) -> Columns | None:
        """The cells from `start` to `stop` if they are finished and undamaged, else None."""
        try:
            with open(self._file(start), "rb") as file:
                packed, sealed = unpack(file)
            header = json.loads(packed["header"].tobytes().decode())
            arrays = {name: packed[f"column{i}"] for i, name in enumerate(header["names"])}
            whole = sealed and header["sweep"] == self.key and header["start"] == start and header["sha256"] == digest(header, arrays)
        except (OSError, ValueError, KeyError, TypeError):  # a FormatError is a ValueError
            return None
        return arrays if whole and all(len(array) == stop - start for array in arrays.values()) else None

    def tidy(self) -> None:
        """Remove files that killed writers left. Younger files may belong to another client."""
        for path in self.out.glob(".armlet-*"):
            with suppress(OSError):
                if time.time() - path.stat().st_mtime > 60:
                    path.unlink()
