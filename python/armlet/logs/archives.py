"""Logs from npz archives, parquet files and runs."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import shown
from ..errors import FormatError, InputError
from ..extras import extra
from ..files import open_regular
from ..run import BatchRun, Run, load
from .assembly import Raw
from .selection import QUANTITIES, Expected, Selection, select

__all__ = ["read_npz", "read_parquet", "read_run"]


def read_npz(path: str, expected: Expected) -> Raw:
    """Read a file of `Run.save`, or arrays (K,) and (K, n) with names such as `t`, `q`, `tau`. `names` may list the joints.

    Raises:
        FormatError: the archive is damaged.
        InputError: the arrays are no log.
    """
    try:
        with open_regular(path) as file, np.load(file, allow_pickle=False) as archive:
            if "header" in archive.files and archive["header"].dtype == np.uint8:
                run = load(path)
                if isinstance(run, BatchRun):
                    raise InputError(f"read_log: {path} is a batch: expected one run")
                return replace(read_run(run, expected), path=path)
            arrays = {name: archive[name] for name in archive.files}
    except (ValueError, EOFError, zipfile.BadZipFile, NotImplementedError) as error:
        if isinstance(error, FormatError | InputError):
            raise
        raise FormatError(f"read_log: {path} is damaged: expected an npz archive, got {error or type(error).__name__}") from None
    listed = arrays.pop("names", arrays.pop("joint_names", None))
    if listed is not None and expected.names is None and listed.dtype.kind == "U" and listed.ndim == 1:
        expected = replace(expected, names=tuple(listed.tolist()))
    columns: dict[str, NDArray[Any]] = {}
    for name, values in arrays.items():
        if values.dtype.kind in "iuf" and values.ndim == 1:
            columns[name] = values
        elif values.dtype.kind in "iuf" and values.ndim == 2:
            columns |= {f"{name}_{i + 1}": values[:, i] for i in range(values.shape[1])}
    return _from_columns(path, columns, expected)


def read_parquet(path: str, expected: Expected) -> Raw:
    """Read a parquet file.

    Raises:
        FormatError: the file is damaged.
        ImportError: pandas, or a library that reads parquet, is not installed.
    """
    pandas = extra("read_log", "pandas", "data")
    try:
        with open_regular(path) as file:
            table = pandas.read_parquet(file)
    except (ImportError, OSError):
        raise
    except Exception as error:  # pandas raises various errors for a damaged file
        raise FormatError(f"read_log: {path} is damaged: expected a parquet file, got {shown(str(error))}") from None
    numeric = {str(name): table[name].to_numpy() for name in table.columns if table[name].dtype.kind in "iuf"}
    return _from_columns(path, numeric, expected)


def _from_columns(path: str, columns: Mapping[str, NDArray[Any]], expected: Expected) -> Raw:
    headers = list(columns)
    if not headers:
        raise InputError(f"read_log: {path} is empty: expected columns of numbers, got none")
    selection = select(headers, expected)
    chosen = {index: np.asarray(columns[headers[index]], dtype=np.float64) for index in selection.indices}
    lengths = {len(values) for values in chosen.values()}
    if len(lengths) > 1:
        raise InputError(f"read_log: {path} has columns of different lengths: expected equal lengths, got {sorted(lengths)}")
    return Raw(path, headers, selection, chosen)


def read_run(run: Run, expected: Expected) -> Raw:
    """Take the records of a run. The desired motion gives the references. A commanded velocity is a reference."""
    n = run.q.shape[1]
    names = expected.names or tuple(getattr(run.arm, "joint_names", None) or (f"joint{i + 1}" for i in range(n)))
    if len(names) != n:
        raise InputError(f"read_log: path has another number of joints: expected {len(names)}, got {n}")
    tables: dict[str, Any] = {"q": run.q, "v": run.v, "theta": run.theta}
    tables |= dict(zip(("q_d", "v_d", "a_d"), run.desired() or (None,) * 3, strict=True))
    forces = all(unit in ("N m", "N") for unit in run.input_units)
    tables |= {"tau": run.tau} if forces else {"v_d": run.tau}
    present = {name: tables[name] for name in QUANTITIES if tables.get(name) is not None}
    columns: dict[int, NDArray[np.float64]] = {0: run.t}
    indices: dict[str, list[int]] = {}
    headers = ["t"]
    for name, values in present.items():
        indices[name] = list(range(len(headers), len(headers) + n))
        headers += [f"{name}_{i + 1}" for i in range(n)]
        columns |= dict(zip(indices[name], values.T, strict=True))
    prismatic = tuple(unit == "m" for unit in run.units)
    selection = Selection(names, prismatic, [(0, 1.0)], indices, {name: [1.0] * n for name in indices})
    return Raw("the run", headers, selection, columns)
