"""Animations of runs: drawing of trees with prismatic and mimic joints, in a plane and in space; GIF, MP4, and refused arguments."""

from __future__ import annotations

import stat
import sys
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from grippers import GRIPPER
from matplotlib.figure import Figure

import armlet as al
from armlet.figures.animation import Film
from armlet.figures.skeleton import Picture, Skeleton

PLANAR = al.load_urdf(al.example_urdf("planar_2r"))
SEVEN = models.SEVEN_AXES
BODY: dict[str, Any] = {"type": "R", "axis": [0, 0, 1], "phi": [1.0, 0.1, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1]}


def moved(arm: al.Arm, q: Any) -> al.Run:
    return al.Run({"t": [0.0, 1.0], "q": [np.zeros(arm.n), q], "v": np.zeros((2, arm.n))}, plant=al.RigidArm(arm))


def test_lines_of_a_tree() -> None:
    """A lift carries two arms, with a revolute and a prismatic joint.

    Links end at joints. A prismatic joint is drawn from its position at zero.
    """
    joints = [
        BODY | {"type": "P", "xyz": [0, 0, 0.2], "name": "lift"},
        BODY | {"axis": [1, 0, 0], "xyz": [0, 0.3, 0], "parent": 0},
        BODY | {"type": "P", "axis": [0, 1, 0], "xyz": [0, -0.3, 0], "parent": 0},
    ]
    arm = al.Arm.from_chain(joints).with_frame("tip", "link3", xyz=[0.0, -0.5, 0.0])
    assert arm.file_joint_parents == (-1, 0, 0) and arm.tip_frame == "tip"
    lines = Skeleton("test", arm).lines(np.array([[0.1, 0.7, -0.2]]))
    np.testing.assert_allclose(lines.joints[0], [[0, 0, 0.3], [0, 0.3, 0.3], [0, -0.5, 0.3]], atol=1e-15)
    lengths = np.linalg.norm(np.diff(lines.slides[0], axis=1)[:, 0], axis=-1)
    np.testing.assert_allclose(lengths, [0.1, 0.0, 0.2], atol=1e-15)
    links = np.array([[[0, 0, 0.0], [0, 0, 0.2]], [[0, 0, 0.3], [0, 0.3, 0.3]], [[0, 0, 0.3], [0, -0.3, 0.3]]])
    np.testing.assert_allclose(lines.links[0, :3], links, atol=1e-15)
    np.testing.assert_allclose(lines.tip[0], [0.0, -1.0, 0.3], atol=1e-15)


@pytest.mark.parametrize("arm", [PLANAR, SEVEN, al.load_urdf(GRIPPER), al.planar_arm([0.3] * 4)], ids=["2", "7", "gripper", "4"])
def test_links_end_at_joints_and_keep_their_lengths(arm: al.Arm) -> None:
    """Each link ends at a joint or a frame. Motion of revolute joints does not change the lengths of links."""
    q = np.random.default_rng(1).uniform(-0.5, 0.5, (6, arm.n))
    lines = Skeleton("test", arm).lines(q)
    lengths = np.linalg.norm(np.diff(lines.links, axis=2)[:, :, 0], axis=-1)
    np.testing.assert_allclose(lengths, np.broadcast_to(lengths[0], lengths.shape), rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(lines.tip, arm.position(q, str(arm.tip_frame)), rtol=0.0, atol=1e-14)
    m = len(arm.file_joint_names)
    np.testing.assert_allclose(lines.slides[:, :, 0], lines.links[:, :m, 1], rtol=0.0, atol=1e-15)


def test_planes_and_space() -> None:
    """If all points are in one plane, the picture shows this plane. Otherwise, or if a view is given, it is three-dimensional."""
    flat = Skeleton("test", PLANAR).lines(np.array([[0.1, 0.2], [0.3, 0.5]])).cloud()
    assert Picture("test", flat, 100).axes == [0, 2] and Picture("test", flat, 100, (30.0, 40.0)).ax.azim == 40.0
    wide = Picture("test", Skeleton("test", SEVEN).lines(np.array([np.ones(7)])).cloud(), 100)
    assert wide.axes == [0, 1, 2] and wide.ax.name == "3d" and wide.ax.get_zlabel() == "z (m)"
    assert np.ptp(wide.ax.get_xlim()) == pytest.approx(np.ptp(wide.ax.get_zlim()))


def test_a_picture_shows_the_arm() -> None:
    """The lines of a picture have the skeleton's points. Pixels differ from those of another configuration."""
    skeleton, q = Skeleton("test", SEVEN), np.array([np.zeros(7), np.full(7, 0.4)])
    lines, figure = skeleton.lines(q), Figure()
    figure.set_dpi(100)
    picture = Picture("test", lines.cloud(), 150)
    picture.show(lines, 0, "t = 0")
    before = picture.pixels()
    picture.show(lines, 1, "t = 1", lines.tip[:1])
    assert before.shape == (150, 150, 3) and (picture.pixels() != before).any()
    np.testing.assert_array_equal(np.array(picture.trace.get_data_3d()).T, lines.tip)
    drawn = np.array(picture.links.get_data_3d()).T.reshape(-1, 3, 3)
    np.testing.assert_array_equal(drawn[:, :2], lines.links[1])
    assert np.isnan(drawn[:, 2]).all()


def test_films_of_arms_in_space(tmp_path: Path) -> None:
    from PIL import Image

    moved(SEVEN, np.full(7, 0.5)).animate(tmp_path / "a.gif", fps=5.0, size=120, view=[20, 30])
    film: Any
    with Image.open(tmp_path / "a.gif") as film:
        assert film.format == "GIF" and film.n_frames == 5 and film.size == (120, 120)


def test_a_notebook_shows_a_film(tmp_path: Path) -> None:
    """The film contains its data, so that the notebook does not depend on the file. The film is also a path."""
    film = moved(PLANAR, [0.3, 0.4]).animate(tmp_path / "a.gif", fps=2.0, size=120)
    assert Path(film).read_bytes()[:3] == b"GIF" and repr(film) == f"<Film: {tmp_path / 'a.gif'}>"
    page = film._repr_html_()
    assert page is not None and page.startswith('<img alt="The arm in motion" src="data:image/gif;base64,R0lGOD')
    Path(film).rename(tmp_path / "b.mp4")
    assert film._repr_html_() is None
    assert str(Film(str(tmp_path / "b.mp4"))._repr_html_()).startswith('<video controls loop src="data:video/mp4;base64,R0lGOD')


def test_the_path_in_a_film_is_that_of_the_tip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The path is that of the tip, also if the last frame of the file belongs to another link."""
    arm = models.TWO_LINKS.with_frame("elbow", "link1")
    assert arm.tip_frame == "link2" and arm.frame_names[-1] == "elbow"
    seen: list[Any] = []
    monkeypatch.setattr(Picture, "show", lambda self, lines, k, title: seen.append((lines.tip[k], title)))
    monkeypatch.setattr(Picture, "pixels", lambda self: np.full((100, 100, 3), len(seen), dtype=np.uint8))
    moved(arm, [0.0, 1.0]).animate(tmp_path / "a.gif", fps=10.0, size=100)
    np.testing.assert_allclose(seen[0][0], [0.9, 0.0, 0.0], atol=1e-12)  # the arm is stretched; error of rounding
    assert seen[3][1] == "t = 0.30 s; orange: path of link2" and len(seen) == 10


#: A replacement for ffmpeg. It writes its arguments and the number of bytes that it received, or fails.
CODER = """#!{python}
import sys
count = len(sys.stdin.buffer.read())
if {fails}:
    sys.exit("no such encoder")
with open(sys.argv[-1], "w") as film:
    film.write(" ".join(sys.argv[1:-1]) + f" {{count}}")
"""


@pytest.mark.parametrize("fails", [False, True])
def test_mp4_by_ffmpeg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: bool) -> None:
    """ffmpeg receives every picture, with even width and height. If it fails, no file remains."""
    program, film = tmp_path / "bin" / "ffmpeg", tmp_path / "a.MP4"
    program.parent.mkdir()
    program.write_text(CODER.format(python=sys.executable, fails=fails))
    program.chmod(program.stat().st_mode | stat.S_IEXEC)
    monkeypatch.setenv("PATH", str(program.parent))
    run = moved(PLANAR, [0.5, 0.5])
    if fails:
        with pytest.raises(OSError, match=r"ffmpeg failed: no such encoder: .*a\.MP4"):
            run.animate(film, fps=4.0, size=121)
        assert not film.exists()
        return
    run.animate(film, fps=4.0, size=121)
    assert "-s 122x122 -r 4 " in film.read_text() and film.read_text().endswith(f" {4 * 122 * 122 * 3}")


def test_refusals(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = moved(PLANAR, [0.5, 0.5])
    with pytest.raises(al.InputError, match=r"Run\.animate: arm is not that of the run: expected 2 joints, got 7"):
        run.animate(tmp_path / "a.gif", SEVEN)
    deep: dict[str, Any] = {}
    for _ in range(5000):
        deep = {"a": deep}
    for path in (deep, b"a.gif", "a\0.gif"):
        with pytest.raises(al.InputError, match=r"^Run\.animate: path "):
            run.animate(path)
    with pytest.raises(al.InputError, match=r"Run\.animate: arm has nothing to draw: expected an arm with frames that move"):
        run.animate(tmp_path / "a.gif", models.PR)
    with pytest.raises(al.InputError, match=r"Run\.animate: view is not finite: .*first bad index 1"):
        run.animate(tmp_path / "a.gif", view=[0.0, np.nan])
    with pytest.raises(al.InputError, match=r"Run\.animate: view has the wrong shape: expected \(2,\)"):
        run.animate(tmp_path / "a.gif", view=[0.0])
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(al.InputError, match=r"Run\.animate: path requires ffmpeg, .*: expected a name that ends in \.gif"):
        run.animate(tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())
