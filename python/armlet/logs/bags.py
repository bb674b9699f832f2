"""Logs from bags of ROS: rosbag2 folders, `.mcap`, `.db3` and `.bag` files, read with the package rosbags.

A `sensor_msgs/JointState` message is a sample. A `trajectory_msgs/JointTrajectory` message is a list of points with their own times.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FormatError, InputError
from ..extras import extra
from .assembly import Raw
from .selection import Expected, Selection

__all__ = ["is_bag", "read_bag"]

_STATE, _TRAJECTORY = "sensor_msgs/msg/JointState", "trajectory_msgs/msg/JointTrajectory"
_SUFFIXES = (".mcap", ".db3", ".bag")
#: The fields of a message or point, with the letters of their quantities.
_FIELDS = {
    _STATE: {"q": "position", "v": "velocity", "tau": "effort"},
    _TRAJECTORY: {"q": "positions", "v": "velocities", "a_d": "accelerations", "tau": "effort"},
}


@dataclass(frozen=True)
class _Sample:
    """A message, or a point of a trajectory, at the time `stamp`, ns."""

    stamp: int
    names: tuple[str, ...]
    values: dict[str, Sequence[float]]


def is_bag(path: str) -> bool:
    """Whether the path is a folder, or a file with the ending of a bag."""
    return Path(path).is_dir() or Path(path).suffix.lower() in _SUFFIXES


def read_bag(path: str, expected: Expected, topic: str | None) -> Raw:
    """Read the messages of one topic.

    Raises:
        ImportError: rosbags is not installed.
        FormatError: the bag is damaged.
        InputError: no topic, or more than one topic, has states or trajectories of joints.
    """
    highlevel, stores = (extra("read_log", module, "logs") for module in ("rosbags.highlevel", "rosbags.typesys"))
    if not Path(path).exists():
        raise FileNotFoundError(f"read_log: {path}: no such file or folder")
    try:
        with highlevel.AnyReader([Path(path)], default_typestore=stores.get_typestore(stores.Stores.ROS2_HUMBLE)) as reader:
            connections, kind = _chosen(path, reader.connections, topic)
            samples = list(_samples(reader, connections, kind))
    except (InputError, MemoryError):
        raise
    except Exception as error:  # rosbags raises errors of its own, of sqlite and of yaml
        raise FormatError(f"read_log: {path} is not a bag or is damaged: {' '.join(str(error).split())[:200]}") from None
    if not samples:
        raise InputError(f"read_log: {path} is empty: expected messages on {connections[0].topic}, got none")
    return _raw(path, samples, kind, expected)


def _chosen(path: str, connections: Sequence[Any], topic: str | None) -> tuple[list[Any], str]:
    """The connections of the topic, and its type. States have precedence over trajectories."""
    for kind in (_STATE, _TRAJECTORY):
        of_kind = [each for each in connections if each.msgtype == kind and topic in (None, each.topic)]
        topics = sorted({each.topic for each in of_kind})
        if len(topics) > 1:
            raise InputError(f"read_log: {path} has several topics with {kind}: expected topic= to choose, got {', '.join(topics)}")
        if topics:
            return of_kind, kind
    listed = ", ".join(sorted(f"{each.topic} ({each.msgtype})" for each in connections)[:20]) or "no topics"
    named = f"has no topic {topic}" if topic is not None else "has no states of joints"
    raise InputError(f"read_log: {path} {named}: expected {_STATE} or {_TRAJECTORY}, got {listed}")


def _samples(reader: Any, connections: Sequence[Any], kind: str) -> Iterator[_Sample]:
    """The samples of the messages, in the order of the bag."""
    for connection, received, data in reader.messages(connections=connections):
        message = reader.deserialize(data, connection.msgtype)
        stamp = _nanoseconds(message.header.stamp) or received
        if kind == _STATE:
            yield _Sample(stamp, tuple(message.name), {key: getattr(message, field) for key, field in _FIELDS[kind].items()})
            continue
        for point in message.points:
            values = {key: getattr(point, field) for key, field in _FIELDS[kind].items()}
            yield _Sample(stamp + _nanoseconds(point.time_from_start), tuple(message.joint_names), values)


def _nanoseconds(time: Any) -> int:
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def _raw(path: str, samples: list[_Sample], kind: str, expected: Expected) -> Raw:
    """The columns of the samples that have all joints. Joints have the order of `expected`, or of the first sample."""
    names = expected.names or samples[0].names
    known = {each.names for each in samples}
    complete = {each: [each.index(name) for name in names] for each in known if set(names) <= set(each)}
    if not names or not complete:
        missing = next((name for name in names if not any(name in each for each in known)), "")
        listed = ", ".join(sorted({name for each in known for name in each}))
        raise InputError(f"read_log: {path} has no joint {missing!r}: expected the joints {', '.join(names)}, got {listed}")
    chosen = [each for each in samples if each.names in complete]
    first = chosen[0].stamp
    columns: dict[int, Any] = {0: np.array([each.stamp - first for each in chosen], dtype=np.int64) * 1e-9}
    indices: dict[str, list[int]] = {}
    headers = ["stamp"]
    for key in _FIELDS[kind]:
        rows = np.full((len(chosen), len(names)), np.nan)
        for row, each in zip(rows, chosen, strict=True):
            if len(each.values[key]) == len(each.names):
                row[:] = np.asarray(each.values[key], dtype=np.float64)[complete[each.names]]
        indices[key] = list(range(len(headers), len(headers) + len(names)))
        columns |= dict(zip(indices[key], rows.T, strict=True))
        headers += [f"{key} of {name}" for name in names]
    others = sorted({name for each in complete for name in each} - set(names))
    remarks = [f"not used: {', '.join(others)}"] if others else []
    remarks += [f"messages without all joints: {len(samples) - len(chosen)}"] if len(chosen) < len(samples) else []
    prismatic = expected.prismatic or (False,) * len(names)
    selection = Selection(names, prismatic, [(0, 1.0)], indices, {key: [1.0] * len(names) for key in indices}, remarks)
    return Raw(path, headers, selection, columns, start=first * 1e-9)
