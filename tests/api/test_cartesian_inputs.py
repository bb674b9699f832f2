"""The Python interface of `cartesian_path`: errors that name a refused argument, timing of its paths, pickles."""

from __future__ import annotations

import math
import pickle
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.TWO_LINKS
ENDS = np.array([[0.6, 0.0], [0.6, 0.4], [0.3, 0.4]])
START = [-0.5, 1.0]
GOOD: dict[str, Any] = {"frame": "link2", "axes": "xy"}


def path(**changed: Any) -> al.CartesianPath:
    given = {"arm": ARM, "poses": ENDS, "q0": START, **GOOD, **changed}
    return al.cartesian_path(given.pop("arm"), given.pop("poses"), given.pop("q0"), **given)


BAD: list[tuple[str, Any]] = [
    ("arm", 3),
    ("arm", None),
    ("poses", [[0.6, 0.0]]),
    ("poses", []),
    ("poses", [[0.6, 0.0, 0.0]] * 2),
    ("poses", [[0.6, math.nan], [0.6, 0.1]]),
    ("poses", [[0.6, math.inf], [0.6, 0.1]]),
    ("poses", [["a", "b"], ["c", "d"]]),
    ("poses", [[0.6, 0.0]] * 3),
    ("poses", np.zeros((2, 4, 4))),
    ("poses", np.tile(2.0 * np.eye(4), (2, 1, 1))),
    ("poses", None),
    ("q0", [0.0]),
    ("q0", [math.nan, 0.0]),
    ("q0", "start"),
    ("frame", "tool"),
    ("frame", 3),
    ("axes", "w"),
    ("axes", ""),
    ("axes", "xx"),
    ("axes", 3),
    ("axes", "rx ry"),
    ("tolerance", 0.0),
    ("tolerance", -1.0),
    ("tolerance", math.nan),
    ("tolerance", [1e-3, 1e-3, 1e-3]),
    ("tolerance", "fine"),
    ("kind", "circle"),
    ("kind", None),
    ("blend", -0.1),
    ("blend", math.inf),
    ("blend", math.nan),
    ("blend", "wide"),
    ("arcs", [0]),
    ("arcs", [2]),
    ("arcs", [-1]),
    ("arcs", [0.5]),
    ("arcs", [math.nan]),
    ("arcs", [math.inf]),
    ("arcs", 1),
    ("arcs", "1"),
    ("arcs", [1, 1]),
    ("limits", np.full(2, np.nan)),
    ("limits", 1),
]


@pytest.mark.parametrize(("name", "bad"), BAD, ids=lambda value: repr(value)[:30])
def test_refusals(name: str, bad: Any) -> None:
    with pytest.raises(al.InputError, match=rf"^cartesian_path: {name} "):
        path(**{name: bad})


ARCS = {
    "overlap": (
        {"poses": [[0.6, 0.0], [0.7, 0.1], [0.6, 0.2], [0.6, 0.4]], "arcs": [1, 2]},
        r"arcs overlap: .* got 2 after 1 \(first bad index 1\)",
    ),
    "one line": ({"poses": [[0.6, 0.0], [0.6, 0.2], [0.6, 0.4]], "arcs": [1]}, r"arcs has no circle at pose 1"),
    "there and back": ({"poses": [[0.6, 0.0], [0.6, 0.2], [0.6, 0.0]], "arcs": [1]}, r"arcs has no circle at pose 1"),
    "a repeated pose": ({"poses": [[0.6, 0.0], [0.6, 0.0], [0.6, 0.2], [0.6, 0.4]], "arcs": [2]}, r"arcs has no circle at pose 2"),
    "the end repeated": ({"poses": [[0.6, 0.0], [0.7, 0.2], [0.7, 0.2]], "arcs": [1]}, r"arcs is out of range"),
    "a spline": ({"kind": "spline", "arcs": [1]}, r"arcs is not used: expected none with kind 'spline'"),
    "one row": ({"axes": "x", "poses": [[0.5], [0.6], [0.7]], "arcs": [1]}, r"arcs is not used: expected none where axes"),
}


@pytest.mark.parametrize("case", ARCS)
def test_refusals_of_arcs(case: str) -> None:
    changed, message = ARCS[case]
    with pytest.raises(al.InputError, match=f"^cartesian_path: {message}"):
        path(**changed)


def test_an_arm_without_frames() -> None:
    with pytest.raises(al.InputError, match=r"^cartesian_path: frame is unknown"):
        path(arm=models.PR)


def test_its_timing() -> None:
    """`time_path` follows the spline of a `CartesianPath`, stops at its corners, and respects the tip's speed limit between them."""
    found = path(tolerance=1e-5)
    limits: dict[str, Any] = {"tau_max": [20.0, 8.0], "tip_speed": 0.4, "tip_acceleration": 3.0, "frame": "link2"}
    timed = al.time_path(ARM, found, stops=found.corners[1:-1], **limits)
    assert timed.feasible and timed.margin >= -1e-9
    s = np.linspace(0.0, 1.0, 501)
    for ours, theirs in zip(found(s), timed.path(s), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9 * np.abs(theirs).max())
    tip = ARM.position(timed(np.linspace(0.0, timed.duration, 2001))[0], "link2")[:, :2]
    apart = np.minimum(np.abs(tip[:, 0] - 0.6) + np.maximum(0.0, -tip[:, 1]), np.abs(tip[:, 1] - 0.4))
    assert apart.max() <= 2e-5
    for name, value in (("knots", [0.0, 1.0]), ("spline", "natural"), ("samples", 99)):
        with pytest.raises(al.InputError, match=rf"^time_path: {name} is not used: expected None for a CartesianPath"):
            al.time_path(ARM, found, tau_max=20.0, **{name: value})  # type: ignore[arg-type]


def test_a_path_that_the_arm_cannot_follow() -> None:
    found = path(poses=[[0.6, 0.0], [1.2, 0.0]])
    assert not found and found.q.shape[1] == 2 and np.isnan(found.error).all()
    assert found.reason is not None and "out of reach" in found.reason and "out of reach" in repr(found)
    for use in (lambda: found(0.5), lambda: al.time_path(ARM, found, tau_max=20.0)):
        with pytest.raises(al.SolveError, match=r"can't follow the poses from s = 0\.5") as caught:
            use()
        assert caught.value.status is al.Status.INFEASIBLE
    # The start of the search may be far from the first pose. It only selects the branch of solutions.
    assert path(q0=[0.5, -1.0]).q[0, 1] < 0.0 < path().q[0, 1]


def test_values_and_places() -> None:
    found = path()
    q, dq, ddq = found([[0.0, 0.5], [1.0, 0.25]])
    assert q.shape == dq.shape == ddq.shape == (2, 2, 2) and found(0.3)[0].shape == (2,)
    np.testing.assert_array_equal(q[0, 0], found.q[0])
    np.testing.assert_allclose(ARM.position(found.q[found.corners], "link2")[:, :2], ENDS, rtol=0.0, atol=1e-8)
    step = 1e-6
    np.testing.assert_allclose((found(0.3 + step)[0] - found(0.3 - step)[0]) / (2 * step), found(0.3)[1], rtol=1e-6)
    np.testing.assert_allclose((found(0.3 + step)[1] - found(0.3 - step)[1]) / (2 * step), found(0.3)[2], rtol=1e-5, atol=1e-5)
    for bad in (-0.1, 1.1, math.nan, "x", [0.0, 2.0]):
        with pytest.raises(al.InputError, match=r"^CartesianPath: s "):
            found(bad)  # type: ignore[arg-type]


def test_pickles() -> None:
    for found in (path(), path(poses=[[0.6, 0.0], [1.2, 0.0]])):
        other = pickle.loads(pickle.dumps(found))
        assert other == found and repr(other) == repr(found) and other.corners == found.corners and found != path(tolerance=1e-6)


def test_repeated_poses() -> None:
    found, plain = path(poses=np.repeat(ENDS, 2, axis=0)), path()
    assert found == plain and found.corners == [k for k in plain.corners for _ in range(2)]
