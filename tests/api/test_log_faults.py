"""Faults of logs: what is reported, what is repaired, and what is refused with line, column or name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet import InputError

ARM = models.TWO_LINKS


def read(tmp_path: Path, text: str | bytes, **options: Any) -> al.Log:
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return al.read_log(path, **options)


REFUSED: dict[str, tuple[str | bytes, dict[str, Any], str]] = {
    "letters": ("t,q1,q2\n0,1,2\n0.1,abc,2\n", {}, r"log\.csv line 3, column 2 \(q1\) is not a number: expected a number, got 'abc'$"),
    "letters in the first row": ("t,q1\n0,abc\n0.1,2\n", {}, r"line 2, column 2 \(q1\) is not a number"),
    "letters after blank lines": (
        "t,q1\n0,1\n\n# note\n0.1,x1\n",
        {},
        r"line 5, column 2 \(q1\) is not a number: expected a number, got 'x1'",
    ),
    "an empty cell": ("t,q1,q2\n0,1,2\n0.1,,2\n", {}, r"line 3, column 2 \(q1\) is not a number: expected a number, got ''"),
    "digits with a line": ("t,q1\n0,1_0\n1,2\n", {}, r"line 2, column 2 \(q1\) is not a number"),
    "a cut line": ("t,q1,q2\n0,1,2\n0.1,1\n", {}, r"line 3 is incomplete: expected 3 columns, got 2"),
    "NaN": ("t,q1,q2\n0,1,2\n0.1,1,nan\n0.2,1,2\n", {}, r"line 3, column 3 \(q2\) is not finite: .*missing='drop'.*got nan"),
    "infinity": ("t,q1\n0,1\n0.1,-inf\n", {}, r"line 3, column 2 \(q1\) is not finite"),
    "infinite time": ("t,q1\n0,1\ninf,2\n", {}, r"line 3, column 1 \(t\) is not finite"),
    "only NaN": ("t,q1\n0,nan\n0.1,nan\n", {}, r"has no positions: expected numbers, got only NaN"),
    "empty": ("", {}, r"log\.csv is empty: expected a header and rows of numbers"),
    "blank": (" \n\n", {}, r"log\.csv is empty"),
    "header alone": ("t,q1,q2\n", {}, r"has no rows of numbers"),
    "words": ("once upon a time\nthere was a robot\n", {}, r"has no rows of numbers"),
    "binary": (b"t,q1\n\0\1\2", {}, r"is not text: expected a text file such as CSV, got binary data"),
    "times that decrease": (
        "t,q1\n0,1\n0.2,2\n0.1,3\n",
        {},
        r"line 4 is not later than the line before: .*repair_clock=True.*got 0.1 s after 0.2",
    ),
    "times that repeat": ("t,q1\n0,1\n0.1,2\n0.1,3\n", {}, r"line 4 is not later"),
    "equal names": ("t,q1,q1\n0,1,2\n1,1,2\n", {}, r"columns have the same name: expected different names, got 'q1'"),
    "equal meanings": ("t,q1,pos1\n0,1,2\n1,1,2\n", {}, r"columns 'q1' and 'pos1' have one meaning"),
    "an ambiguous name": ("t,q1,qd1\n0,1,2\n1,1,2\n", {}, r"column 'qd1' may be a velocity or a desired position: expected columns="),
    "no times": ("q1\n0\n1\n", {}, r"has no times: expected a column such as time, or dt="),
    "no positions": ("t,tau1\n0,1\n1,2\n", {}, r"has no positions: expected a column of positions for each joint, got tau"),
    "no joints": ("t,x\n0,1\n1,2\n", {}, r"the file has no joints: expected columns such as q1"),
    "an unknown joint": (
        "t,a_pos\n0,1\n1,2\n",
        {"names": ["a", "b"]},
        r"q of joint 'b' is missing: expected a column for each joint, got a",
    ),
    "another number of joints": (
        "t,q1,q2,q3\n0,1,2,3\n1,1,2,3\n",
        {"arm": ARM},
        r"columns of q do not fit the joints joint1, joint2: .*2, got 3",
    ),
    "an unknown unit": ("t,q1\n0,1\n1,2\n", {"units": {"q": "furlong"}}, r"units of q1 are unknown: .*got 'furlong'"),
    "a unit of another quantity": (
        "t,q1\n0,1\n1,2\n",
        {"units": {"q": "kN"}},
        r"units of q1 do not fit: expected a unit of rad or m, got 'kN'",
    ),
    "metres that turn": ("t,q1 [m],q2\n0,1,1\n1,2,1\n", {"arm": ARM}, r"units of q1 \[m\] do not fit: expected a unit of rad, got 'm'"),
    "too few units": ("t,q1,q2\n0,1,1\n1,2,1\n", {"units": {"q": ["deg"]}}, r"units of q have the wrong size: expected 2, got 1"),
    "units of nothing": ("t,q1\n0,1\n1,2\n", {"units": {"x": "deg"}}, r"units is unknown: expected one of t, q, v"),
    "an unknown column": ("t,q1\n0,1\n1,2\n", {"columns": {"q": ["z"]}}, r"columns has an unknown column: expected one of t, q1, got 'z'"),
    "two times": ("t,q1\n0,1\n1,2\n", {"columns": {"t": ["t", "q1"]}}, r"columns of t are too many"),
    "equal joints": ("t,q1,q2\n0,1,2\n1,1,2\n", {"names": ["a", "a"]}, r"names are not different"),
    "another word for missing": ("t,q1\n0,1\n1,2\n", {"missing": "skip"}, r"missing is unknown: expected one of refuse, drop"),
    "a negative interval": ("q1\n0\n1\n", {"dt": -0.1}, r"dt is out of range"),
    "a topic": ("t,q1\n0,1\n1,2\n", {"topic": "/a"}, r"topic takes effect only with a bag"),
    "no arm": ("t,q1\n0,1\n1,2\n", {"arm": "robot"}, r"arm is of the wrong type"),
    "a word for a flag": ("t,q1\n0,1\n1,2\n", {"unwrap": "no"}, r"unwrap is of the wrong type"),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_refused(fault: str, tmp_path: Path) -> None:
    text, options, message = REFUSED[fault]
    with pytest.raises(InputError, match=rf"^read_log: .*{message}"):
        read(tmp_path, text, **options)


def test_other_files(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        al.read_log(tmp_path / "none.csv")
    with pytest.raises(InputError, match=r"^read_log: path is of the wrong type"):
        al.read_log(3)  # type: ignore[arg-type]
    (tmp_path / "a.npz").write_bytes(b"PK\3\4 damaged")
    with pytest.raises(al.FormatError, match=r"is damaged: expected an npz archive"):
        al.read_log(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", t=[0.0, 1.0], q=[[1.0], [2.0], [3.0]])
    with pytest.raises(InputError, match=r"has columns of different lengths: expected equal lengths, got \[2, 3\]"):
        al.read_log(tmp_path / "b.npz")
    np.savez(tmp_path / "c.npz", note="text")
    with pytest.raises(InputError, match=r"is empty: expected columns of numbers"):
        al.read_log(tmp_path / "c.npz")
    batch = al.simulate_batch(al.RigidArm(ARM), al.PDGravity(ARM, [0.1, 0.2], 20.0, 5.0), np.zeros((2, 2)), t_end=0.1, dt=0.01)
    with pytest.raises(InputError, match=r"path is a batch: expected one run, such as batch\[0\]"):
        al.read_log(batch)  # type: ignore[arg-type]
    batch.save(tmp_path / "batch.npz")
    with pytest.raises(InputError, match=r"batch.npz is a batch: expected one run"):
        al.read_log(tmp_path / "batch.npz")


def moving(tmp_path: Path, t: Any, q: Any, **options: Any) -> al.Log:
    rows = "".join(f"{a:.9f},{b:.12f}\n" for a, b in zip(t, q, strict=True))
    return read(tmp_path, "t,q1\n" + rows, **options)


def test_clock_jumps_and_dropped_samples_are_distinguished(tmp_path: Path) -> None:
    """Both have long intervals. The motion continues over lost samples, and does not over a jump of the clock."""
    true = 0.01 * np.arange(400)
    q = np.sin(3.0 * true)
    received = np.ones(400, dtype=bool)
    received[[50, 51, 200]] = False
    stamps = true + 0.07 * (true > 1.2) + 2.0 * (true > 3.0)
    log = moving(tmp_path, stamps[received], q[received])
    assert log.report.dropped == 3 and [count for _, count in log.report.gaps] == [2, 1]
    np.testing.assert_allclose(log.report.clock_jumps, [[1.2, 0.07], [3.07, 2.0]], atol=1e-6)
    assert not log.report.repaired and "clock jump of 0.07 s after 1.2 s" in str(log.report)
    fixed = moving(tmp_path, stamps[received], q[received], repair_clock=True)
    np.testing.assert_allclose(fixed.t, true[received], atol=1e-8)
    assert fixed.report.repaired and fixed.report.dropped == 3


def test_a_jump_backwards_is_repaired(tmp_path: Path) -> None:
    true = 0.01 * np.arange(100)
    log = moving(tmp_path, true - 0.3 * (true > 0.5), np.sin(true), repair_clock=True)
    np.testing.assert_allclose(log.t, true, atol=1e-8)
    assert log.report.clock_jumps == ((pytest.approx(0.5), pytest.approx(-0.3)),)
    with pytest.raises(InputError, match="has no clock: expected times that increase somewhere"):
        moving(tmp_path, [0.0, 0.0, 0.0], [1.0, 2.0, 3.0], repair_clock=True)


def test_uneven_times(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    even = 0.01 * np.arange(500)
    assert not moving(tmp_path, even, np.sin(even)).report.uneven
    jitter = moving(tmp_path, even + 2e-4 * rng.normal(size=500), np.sin(even)).report
    assert jitter.uneven and jitter.jitter == pytest.approx(2e-4 * np.sqrt(2.0), rel=0.15) and jitter.dropped == 0
    irregular = moving(tmp_path, np.cumsum(rng.exponential(0.01, 500) + 1e-4), np.sin(even)).report
    assert irregular.dropped == 0 and "the intervals are irregular" in str(irregular)


def test_repeated_and_incomplete_samples(tmp_path: Path) -> None:
    text = "t,q1,v1,tau1\n0,1,nan,1\n1,2,nan,nan\n2,3,nan,3\n2,3,nan,3\n3,4,nan,4\n4,5,nan,5\n5,6,nan,6\n"
    log = read(tmp_path, text, missing="drop")
    assert (log.report.repeated, log.report.incomplete, log.report.dropped) == (1, 1, 1)
    assert log.v is None and "v has no values" in str(log.report) and log.t.tolist() == [0.0, 2.0, 3.0, 4.0, 5.0]


def test_wraps(tmp_path: Path) -> None:
    t = 0.01 * np.arange(700)
    folded = (2.0 * t + np.pi) % (2.0 * np.pi) - np.pi
    log = moving(tmp_path, t, folded)
    np.testing.assert_allclose(log.q[:, 0], 2.0 * t, atol=1e-9)
    assert log.report.wraps == (2,) and "wrapped angles continued: joint1 (2)" in str(log.report)
    # Four radians in one sample are no turn: a faulty reading does not change.
    faulty = np.where(t == t[300], 4.0, 0.0) + 0.01 * t
    np.testing.assert_allclose(moving(tmp_path, t, faulty).q[:, 0], faulty, atol=1e-9)
    rail = read(tmp_path, "t,q1 [m]\n" + "".join(f"{a:.9f},{b:.12f}\n" for a, b in zip(t, folded, strict=True)))
    np.testing.assert_allclose(rail.q[:, 0], folded, atol=1e-9)
    degrees = moving(tmp_path, t, 100.0 * np.sin(t))
    assert "positions of joint1 exceed 40 rad: if they are degrees" in str(degrees.report)


def test_methods_of_a_log() -> None:
    t = 0.01 * np.arange(100)
    log = al.Log(t, np.sin(t)[:, None])
    for call, message in (
        (lambda: al.Log(t[::-1], np.sin(t)[:, None]), r"^Log: t does not increase: .*\(first bad index 1\)"),
        (lambda: al.Log(t, np.sin(t)), r"^Log: q "),
        (lambda: al.Log(t, np.full((100, 1), np.nan)), r"^Log: q is not finite"),
        (lambda: al.Log(t, np.zeros((99, 1))), r"^Log: q has the wrong length: expected 100 samples, got 99"),
        (lambda: al.Log(t, np.zeros((100, 1)), v=np.zeros((100, 2))), r"^Log: v "),
        (lambda: al.Log(t, np.zeros((100, 1)), references={"x": np.zeros((100, 1))}), r"^Log: references is unknown"),
        (lambda: al.Log(t, np.zeros((100, 2)), names=["a", "a"]), r"^Log: names are not different"),
        (lambda: al.Log(t, np.zeros((100, 2)), names=["a"]), r"^Log: names have the wrong size"),
        (lambda: al.Log(t, np.zeros((100, 1)), units=["deg"]), r"^Log: units is unknown"),
        (lambda: log.cut(2.0, 3.0), r"^Log.cut: t0, t1 contain no sample"),
        (lambda: log.cut(np.nan, 3.0), r"^Log.cut: t0, t1 contain no sample"),
        (lambda: log.resample(0.0), r"^Log.resample: dt is out of range"),
        (lambda: log.resample(1e-300), r"^Log.resample: dt is too small"),
        (lambda: log.filter(50.0), r"^Log.filter: cutoff is too high: expected less than 50 Hz, got 50"),
        (lambda: log.filter(5.0, order=0), r"^Log.filter: order is not a count"),
        (lambda: al.Log(t**2, np.sin(t)[:, None]).filter(5.0), r"^Log.filter: t is uneven: expected equal intervals: call resample first"),
    ):
        with pytest.raises(InputError, match=message):
            call()
    assert len(al.Log(t[:1], np.zeros((1, 1))).resample(0.1).filter(5.0)) == 1
