"""Convert runs for other programs: CSV files, Parquet files (with pyarrow) and xarray datasets. Each written file is complete or absent."""

from __future__ import annotations

import io
from collections.abc import Mapping
from os import PathLike
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..extras import extra
from ..files import write_whole
from .recorded import SERIES, Recorded

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["pandas_for", "to_csv", "to_parquet", "to_xarray"]

Columns = Mapping[str, NDArray[Any]]


def to_csv(columns: Columns, path: str | PathLike[str]) -> None:
    """Write columns of equal length as CSV, with a header line. Each float becomes the shortest text that reads back as the same float."""
    lists = [np.asarray(values).tolist() for values in columns.values()]

    def write(file: IO[bytes]) -> None:
        text = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=False)
        text.write(",".join(columns) + "\n")
        for row in zip(*lists, strict=True):
            text.write(",".join(map(_cell, row)) + "\n")
        text.flush()
        text.detach()

    write_whole(path, write)


def _cell(value: Any) -> str:
    text = value if isinstance(value, str) else repr(value)
    return '"' + text.replace('"', '""') + '"' if set(text) & set(',"\n') else text


def to_parquet(columns: Columns, path: str | PathLike[str]) -> None:
    """Write columns of equal length as Parquet.

    Raises:
        ImportError: pyarrow is not installed.
    """
    pyarrow, parquet = (extra("Run.to_parquet", module, "data") for module in ("pyarrow", "pyarrow.parquet"))
    table = pyarrow.table({name: pyarrow.array(np.asarray(values)) for name, values in columns.items()})
    write_whole(path, lambda file: parquet.write_table(table, file))


def to_xarray(run: Recorded) -> xr.Dataset:
    """Return the series of a run as a dataset with the coordinates `t` and `joint`. The units are attributes.

    Raises:
        ImportError: xarray is not installed.
    """
    xarray = extra("Run.to_xarray", "xarray", "data")
    unit = ", ".join(dict.fromkeys(run.units))
    force = ", ".join(dict.fromkeys(run.input_units))
    units = {"q": unit, "theta": unit, "tau": force, "estimate": "SI", "friction": force, "bristles": unit}
    variables: dict[str, Any] = {}
    for name in SERIES:
        values = getattr(run, name)
        if values is not None:
            axis = "parameter" if name == "estimate" else "joint"
            variables[name] = (("t", axis), values, {"units": units.get(name, f"({unit})/s")})
    variables |= {name: (("t",), values) for name, values in run.monitors.items()}
    coordinates = {"t": ("t", run.t, {"units": "s"}), "joint": np.arange(1, run.q.shape[1] + 1)}
    attributes = {"law": run.law_name, "status": run.status.name.lower()}
    found: xr.Dataset = xarray.Dataset(variables, coordinates, attributes)
    return found


def pandas_for(caller: str) -> Any:
    """Import pandas for the function with the name `caller`.

    Raises:
        ImportError: pandas is not installed.
    """
    return extra(caller, "pandas", "data")
