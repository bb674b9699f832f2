"""Bags of ROS: states and trajectories of joints in rosbag2 folders and MCAP files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armlet as al

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

STORE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
START = 1_700_000_000_000_000_000
NONE = np.zeros(0)


def made(kind: str, **fields: Any) -> Any:
    return STORE.types[kind](**fields)


def header(ns: int) -> Any:
    stamp = made("builtin_interfaces/msg/Time", sec=ns // 10**9, nanosec=ns % 10**9)
    return made("std_msgs/msg/Header", stamp=stamp, frame_id="")


def state(ns: int, names: list[str], q: Any, tau: Any = NONE) -> Any:
    fields = {"name": names, "position": np.array(q), "velocity": NONE, "effort": np.array(tau)}
    return made("sensor_msgs/msg/JointState", header=header(ns), **fields)


def trajectory(ns: int) -> Any:
    points = [
        made(
            "trajectory_msgs/msg/JointTrajectoryPoint",
            positions=np.array([x, 2.0 * x]),
            velocities=np.array([1.0, 2.0]),
            accelerations=NONE,
            effort=NONE,
            time_from_start=made("builtin_interfaces/msg/Duration", sec=int(x), nanosec=int(1e9 * (x % 1.0))),
        )
        for x in (0.0, 0.5, 3.0)
    ]
    return made("trajectory_msgs/msg/JointTrajectory", header=header(ns), joint_names=["a", "b"], points=points)


def write(folder: Path, messages: list[tuple[str, int, Any]], storage: str = "MCAP") -> Path:
    with rosbag2.Writer(folder, version=9, storage_plugin=rosbag2.StoragePlugin[storage]) as writer:
        connections: dict[str, Any] = {}
        for topic, ns, message in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], ns, STORE.serialize_cdr(message, kind))
    return folder


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_states_and_trajectories(storage: str, tmp_path: Path) -> None:
    messages = [
        ("/js", START, state(START + 1_000_000 * k, ["b", "a", "grip"], [0.02 * k, 0.01 * k, 9.0], [np.nan] * 3)) for k in range(10)
    ]
    bag = write(tmp_path / "bag", [*messages, ("/plan", START, trajectory(START))], storage)
    single = next(path for path in bag.iterdir() if path.suffix != ".yaml")
    for path in (bag, single):
        log = al.read_log(path, arm=None, names=["a", "b"])
        np.testing.assert_allclose(log.t, 1e-3 * np.arange(10), atol=1e-15)
        np.testing.assert_allclose(log.q, np.outer(np.arange(10), [0.01, 0.02]))
        assert log.v is None and log.tau is None and log.start == 1.7e9
        assert "not used: grip" in str(log.report) and "tau has no values" in str(log.report)
        plan = al.read_log(path, topic="/plan")
        assert plan.names == ("a", "b") and plan.t.tolist() == [0.0, 0.5, 3.0] and plan.v is not None
        assert plan.v.tolist() == [[1.0, 2.0]] * 3


def test_messages_of_several_publishers_and_without_stamps(tmp_path: Path) -> None:
    """A message without all joints is no sample. Without a stamp, the time of reception counts."""
    messages = []
    for k in range(6):
        names, q = (["grip"], [1.0]) if k % 2 else (["a", "b"], [1.0 * k, 2.0])
        message = state(0, names, q, [3.0] * len(names))
        messages.append(("/js", START + 10_000_000 * k, message))
    log = al.read_log(write(tmp_path / "bag", messages))
    np.testing.assert_allclose(log.t, [0.0, 0.02, 0.04])
    assert log.tau is not None and log.tau.tolist() == [[3.0, 3.0]] * 3 and "messages without all joints: 3" in str(log.report)


def test_bad_bags(tmp_path: Path) -> None:
    two = write(tmp_path / "two", [(topic, START, state(START, ["a"], [1.0])) for topic in ("/x", "/y")])
    empty = write(tmp_path / "empty", [("/plan", START, trajectory(START)), ("/h", START, header(START))])
    for path, options, message in (
        (two, {}, r"has several topics with sensor_msgs/msg/JointState: expected topic= to choose, got /x, /y"),
        (two, {"topic": "/z"}, r"has no topic /z: expected sensor_msgs/msg/JointState or .*, got /x \(sensor_msgs/msg/JointState\), /y"),
        (two, {"topic": 3}, r"topic is not a text"),
        (two, {"topic": "/x", "names": ["b"]}, r"has no joint 'b': expected the joints b, got a"),
        (empty, {"topic": "/h"}, r"has no topic /h"),
    ):
        with pytest.raises(al.InputError, match=message):
            al.read_log(path, **options)  # type: ignore[arg-type]
    (tmp_path / "x.mcap").write_bytes(b"junk")
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "x.mcap", tmp_path / "folder"):
        with pytest.raises(al.FormatError, match="is not a bag or is damaged"):
            al.read_log(path)
    with pytest.raises(FileNotFoundError):
        al.read_log(tmp_path / "none.mcap")
