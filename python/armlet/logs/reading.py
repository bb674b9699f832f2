"""`read_log`: read a recording from a file of any known kind, or from a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from .. import _core
from ..arguments import choice, entries, file_path, instance, positive, shown, text
from ..border import border
from ..errors import InputError
from ..run import BatchRun, Run
from .archives import read_npz, read_parquet, read_run
from .assembly import Raw, assembled
from .bags import is_bag, read_bag
from .log import Log
from .selection import QUANTITIES, Expected, select
from .text import open_table

__all__ = ["read_log"]

_NAME = "read_log"


@border
def read_log(
    path: str | PathLike[str] | Run,
    *,
    arm: _core.Arm | None = None,
    names: Sequence[str] | None = None,
    units: Mapping[str, Any] | None = None,
    columns: Mapping[str, Any] | None = None,
    dt: float | None = None,
    topic: str | None = None,
    missing: str = "refuse",
    repair_clock: bool = False,
    unwrap: bool = True,
) -> Log:
    """Read a recorded motion, and report faults of its times and angles.

    Files are CSV and other text with columns, `.npz`, `.parquet`, rosbag2 folders and `.mcap`. The name of a column states its quantity,
    such as `q`, `velocity` or `effort`, and the name or the number of a joint. Words such as `desired`, `cmd` or the ending `_d` mark
    references. Units may be in the name, such as `q1 [deg]` or `elbow_pos_deg`.

    Args:
        path: the file or folder, or a `Run`.
        arm: the arm of the log. Its joints determine names, order and kinds of the columns (keyword only).
        names: names of the joints in their order, without an arm. None: the joints of the file (keyword only).
        units: units by quantity, such as `{"q": "deg", "t": "ms"}`: a unit, or one per joint. They replace those of the file
            (keyword only).
        columns: names or indices of columns by quantity, such as `{"t": "time", "q": ["a", "b"]}`. Quantities are `t`, `q`, `v`, `tau`,
            `theta` (motor positions), and the references `q_d`, `v_d`, `a_d`, `tau_d` (keyword only).
        dt: interval of the samples, s, for a file without times (keyword only).
        topic: topic of a bag; None if only one fits (keyword only).
        missing: for cells that are NaN: `"refuse"` raises an error, `"drop"` removes the samples (keyword only).
        repair_clock: whether one median interval replaces each jump of the clock (keyword only).
        unwrap: whether angles that jump by a turn are continued (keyword only).

    Returns:
        The log (`armlet.Log`). Its times begin at zero, and `log.start` is the clock's value there. A quantity without any value is None.
        `log.report` lists uneven intervals, dropped samples, jumps of the clock, wraps, units and columns that are not used.

    Raises:
        InputError: an argument is not valid, or the file has no valid log. The message has the line and the column of a faulty cell.
        FormatError: an archive is damaged.
        ImportError: pandas or rosbags is not installed, which parquet files or bags require.
        OSError: the file cannot be read.

    Source: docs/logs.md.

    >>> import tempfile, pathlib
    >>> import armlet as al
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "log.csv"
    >>> _ = path.write_text("time [ms];elbow_pos_deg;elbow_effort\\n0;178;1.5\\n10;-179;1.5\\n20;-177;1.4\\n40;-175;1.4\\n")
    >>> log = al.read_log(path)
    >>> log.names, log.t, log.q[:, 0].round(2)
    (('elbow',), array([0.  , 0.01, 0.02, 0.04]), array([3.11, 3.16, 3.19, 3.23]))
    >>> log.report.dropped, log.report.wraps, log.report.remarks
    (1, (1,), ('SI units assumed for tau',))
    """
    expected = _expected(arm, names, units, columns)
    choice(_NAME, "missing", missing, ("refuse", "drop"))
    step = None if dt is None else positive(_NAME, "dt", dt)
    if isinstance(path, BatchRun):
        raise InputError(f"{_NAME}: path is a batch: expected one run, such as batch[0]")
    raw = read_run(path, expected) if isinstance(path, Run) else _from_file(file_path(_NAME, path), expected, topic)
    drop, repair = missing == "drop", instance(_NAME, "repair_clock", repair_clock, bool, "True or False")
    return assembled(raw, step, drop=drop, repair=repair, unwrap=instance(_NAME, "unwrap", unwrap, bool, "True or False"))


def _expected(arm: object, names: object, units: object, columns: object) -> Expected:
    """Check the arguments that describe the file."""
    stated: list[dict[str, Any]] = []
    for name, value in (("units", units), ("columns", columns)):
        table: Mapping[str, Any] = {} if value is None else instance(_NAME, name, value, Mapping, "a dict")
        stated.append({choice(_NAME, name, key, ("t", *QUANTITIES)): each for key, each in table.items()})
    prismatic: tuple[bool, ...] | None = None
    listed = None if names is None else [text(_NAME, "names", each) for each in entries(_NAME, "names", names, 10_000)]
    if arm is not None:
        joints = instance(_NAME, "arm", arm, _core.Arm, "an arm")
        if listed is not None and len(listed) != joints.n:
            raise InputError(f"{_NAME}: names have the wrong size: expected {joints.n}, got {len(listed)}")
        listed = listed or list(joints.joint_names)
        prismatic = tuple(kind == "prismatic" for kind in joints.joint_types)
    if listed is not None and (not listed or len(set(listed)) < len(listed)):
        raise InputError(f"{_NAME}: names are not different: expected at least one name, each once, got {shown(listed)}")
    return Expected(_NAME, None if listed is None else tuple(listed), prismatic, *stated)


def _from_file(path: str, expected: Expected, topic: str | None) -> Raw:
    """Read a file or a folder by its kind."""
    kind = Path(path).suffix.lower()
    if is_bag(path):
        return read_bag(path, expected, None if topic is None else text(_NAME, "topic", topic))
    if topic is not None:
        raise InputError(f"{_NAME}: topic takes effect only with a bag: expected None, got {shown(topic)}")
    if kind == ".npz":
        return read_npz(path, expected)
    if kind in (".parquet", ".pq"):
        return read_parquet(path, expected)
    table = open_table(_NAME, path)
    selection = select(table.headers, expected)
    indices = selection.indices
    return Raw(path, table.headers, selection, dict(zip(indices, table.read(indices).T, strict=True)), table.line)
