"""The figure of an arm: what it draws, in a plane and in space, and refused arguments."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from boxes import faults
from matplotlib.figure import Figure

import armlet as al
from armlet.figures.style import COLOURS

TWO = models.TWO_LINKS
SEVEN = models.SEVEN_AXES
Q = np.array([0.2, 0.6, 0.1, -1.3, 0.2, 0.9, 0.3])


def points(line: Any) -> np.ndarray[Any, Any]:
    """The points of a line, (points, 2 or 3), m."""
    return np.transpose(line.get_data_3d() if hasattr(line, "get_data_3d") else line.get_data())


def bars(ax: Any) -> list[Any]:
    """The axes of the joints: lines of two points with a colour of the joints and a butt end."""
    return [line for line in ax.get_lines() if line.get_solid_capstyle() == "butt" and len(points(line)) == 2]


def written(ax: Any) -> list[str]:
    return [line.strip() for text in ax.texts for line in text.get_text().split("\n")]


def test_a_planar_arm_is_drawn_in_its_plane() -> None:
    ax = TWO.show([0.3, 0.9], fig=Figure())
    assert (ax.name, ax.get_xlabel(), ax.get_ylabel()) == ("rectilinear", "x (m)", "y (m)")
    # The arm of `planar_arm` ends at its second frame.
    ends = np.concatenate([points(line) for line in ax.get_lines()])
    assert np.isclose(ends, TWO.position([0.3, 0.9], "link2")[:2]).all(axis=1).any()
    assert written(ax) == ["W", "link2"]
    assert [text.get_text() for text in ax.figure.legends[0].get_texts()] == ["joint1", "joint2"]
    assert ax.figure.legends[0].get_title().get_text() == "joint"


def test_an_arm_in_space_shows_the_axes_of_its_joints() -> None:
    ax = SEVEN.show(Q, fig=Figure())
    assert (ax.name, ax.get_zlabel(), written(ax)) == ("3d", "z (m)", ["W", "tcp"])
    drawn = bars(ax)
    assert [bar.get_color() for bar in drawn] == list(COLOURS[:7])
    J = SEVEN.jacobian(Q, "tcp")
    for i, bar in enumerate(drawn):
        along = np.diff(points(bar), axis=0)[0]
        np.testing.assert_allclose(along / np.linalg.norm(along), J[3:, i], atol=1e-12)
        # The joint is the middle of its bar.
        origin = SEVEN.file_joint_poses(Q)[i, :3, 3]
        np.testing.assert_allclose(points(bar).mean(axis=0), origin, atol=1e-12)


def test_the_axis_of_a_prismatic_joint_and_a_mimic_joint() -> None:
    """The bar of a prismatic joint has the direction of its motion. A mimic joint has no bar, because `q` has no number for it."""
    finger = {"type": "P", "axis": [1, 0, 0], "parent": 0, "phi": [0.2, 0, 0, 0.01, 0.001, 0, 0.001, 0, 0, 0.001]}
    wrist = {"type": "R", "axis": [0, 0, 1], "phi": [1.0, 0, 0, 0.05, 0.01, 0, 0.01, 0, 0, 0.01]}
    arm = al.Arm.from_chain([wrist, finger | {"name": "left"}, finger | {"name": "right", "axis": [-1, 0, 0], "mimic": {"joint": 1}}])
    ax = arm.show([np.pi / 2, 0.03], view=[20.0, 30.0], fig=Figure())
    slide = np.diff(points(bars(ax)[1]), axis=0)[0]
    assert len(bars(ax)) == 2 and slide[1] > 0.0
    np.testing.assert_allclose(slide / np.linalg.norm(slide), [0.0, 1.0, 0.0], atol=1e-15)


def test_named_frames_have_axes() -> None:
    """The axes of a frame are the columns of its rotation matrix. Frames with one origin have one label."""
    ax = SEVEN.show(Q, frames=["link4", "tcp"], fig=Figure())
    assert written(ax) == ["W", "link4", "tcp"]
    for name in ("link4", "tcp"):
        pose = SEVEN.pose(Q, name)
        starting = [points(line) for line in ax.get_lines() if len(points(line)) == 2 and np.allclose(points(line)[0], pose[:3, 3])]
        directions = np.array([np.diff(line, axis=0)[0] / np.linalg.norm(np.diff(line, axis=0)) for line in starting])
        assert np.isclose(np.abs(directions @ pose[:3, :3]), np.eye(3)[:, None]).all(axis=-1).any(axis=1).all()
    same = SEVEN.with_frame("glove", "tcp").show(Q, frames=["tcp", "glove"], fig=Figure())
    assert [text.get_text().split() for text in same.texts] == [["W"], ["tcp", "glove"]]
    assert written(SEVEN.show(Q, frames="hand", fig=Figure())) == ["W", "hand"]
    assert written(SEVEN.show(Q, frames=[], fig=Figure())) == ["W"]


def test_branches_are_named_unless_they_are_close() -> None:
    two = al.load_urdf(al.example_urdf("two_arms"))
    assert {"left_hand", "right_hand"} < set(written(two.show(np.full(two.n, 0.2), fig=Figure())))


def test_many_joints_have_no_legend() -> None:
    arm = al.planar_arm([0.1] * 20)
    ax = arm.show(np.full(20, 0.1), fig=Figure())
    assert not ax.figure.legends and len(bars(ax)) == 20 and len({bar.get_color() for bar in bars(ax)}) == 1


@pytest.mark.parametrize("view", [None, [10.0, 100.0], [35.0, 20.0]])
@pytest.mark.parametrize("name", ["planar_2r", "planar_pr", "macro_micro_4r", "six_axis", "seven_axis", "two_arms"])
def test_texts_do_not_overlap(name: str, view: list[float] | None) -> None:
    arm = al.load_urdf(al.example_urdf(name))
    figure = Figure()
    arm.show(np.resize([0.3, 0.5, -0.4, 1.1, -0.8], arm.n), view=view, fig=figure)
    assert faults(figure) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"q": [0.0]}, r"Arm\.show: q has the wrong shape: expected \(7,\), got \(1,\)"),
        ({"q": [0.0] * 6 + [np.inf]}, r"Arm\.show: q is not finite: .*first bad index 6"),
        ({"view": [0.0]}, r"Arm\.show: view has the wrong shape: expected \(2,\)"),
        ({"view": [0.0, np.nan]}, r"Arm\.show: view is not finite"),
        ({"frames": ["tcp", "tool"]}, r"Arm\.show: frames\[1\] is unknown: expected one of base, link1, .*, got 'tool'"),
        ({"frames": 3}, r"Arm\.show: frames is not a sequence"),
        ({"fig": 3}, r"plot: fig is of the wrong type"),
    ],
)
def test_refused_arguments(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        SEVEN.show(**{"q": Q} | arguments)


def test_an_arm_without_frames_is_refused() -> None:
    with pytest.raises(al.InputError, match=r"Arm\.show: arm has nothing to draw: expected an arm with frames that move"):
        models.PR.show([0.0, 0.0])
