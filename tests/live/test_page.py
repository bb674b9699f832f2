"""Pages of the laboratory and the viewer without a browser: the server draws them, and their controls change the model.

`make test-browser` opens the same pages in a browser.
"""

from __future__ import annotations

import importlib
import re
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from markdown_it import MarkdownIt

import armlet as al
from armlet import live
from armlet.arguments import one_line
from armlet.live.lab import LabPage
from armlet.live.model import Lab
from armlet.live.origin import refuses_strangers
from armlet.live.scene import mesh_of
from armlet.live.server import address, close_server, open_server, serve
from armlet.live.shapes import Shape, between
from armlet.live.systems import AdaptivePR, Choice, Elastic, Limits, MinimumTime, Priority, Robot
from armlet.live.view import ViewPage, roll_pitch_yaw
from armlet.live.words import escaped
from armlet.rotations import of_matrix


@pytest.fixture
def server() -> Iterator[Any]:
    server = open_server("test", "127.0.0.1", 0)
    yield server
    close_server(server)


def until(holds: Callable[[], object]) -> None:
    """Wait until `holds()` is true, at most 10 s: viser calls the callbacks of controls in other threads."""
    end = time.monotonic() + 10.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_every_system_has_its_page(server: Any) -> None:
    systems = [AdaptivePR(), Priority(), Limits(), Elastic(), MinimumTime(), Robot(al.example_urdf("two_arms"), "two_arms")]
    page = LabPage(server, Lab(systems))
    names: list[str] = []
    for system in systems:
        page.menu.value = system.title
        until(lambda system=system: (page.frame(0.016), page.model.system is system)[1])  # type: ignore[misc]
        for _ in range(40):
            page.frame(0.016)
        assert page.model.t > 0.5 and set(page.gizmos) == set(system.targets)
        for plot, chart in zip(system.plots, page.charts, strict=True):
            assert chart.title == plot.title and len(chart.data) == len(chart.series) == 1 + len(plot.curves)
            assert chart.data[0][-1] == 0.0 and [line["label"] for line in chart.series[1:]] == list(plot.curves)
        for frame, pose in page.model.poses().items():
            drawn = page.scene.frames[frame]
            # The page updates the poses in every second frame. An arm at 1 m/s moves about 3 cm in that time.
            assert np.abs(drawn.position - pose[:3, 3]).max() < 0.05
        names += [handle.name for handle in page.scene.frames.values()]
    # Names of frames are never used twice: viser keeps the pose of a removed frame for a new one with the same name.
    assert len(set(names)) == len(names)


def test_a_slider_of_powers_shows_its_number(server: Any) -> None:
    """The label of the slider contains the number, not only its exponent, and the marks are the powers of ten."""
    page = LabPage(server, Lab([Elastic()]))
    share = page.controls["share"]
    assert share.label == "reduced inertia B0/B: 0.05 = 10^"
    assert [mark.label for mark in share._marks] == ["1e-05", "0.0001", "0.001", "0.01", "0.1", "1"]
    share.value = -2.5
    until(lambda: page.controls["share"].label == "reduced inertia B0/B: 0.00316 = 10^")
    assert page.controls["stiffness"].label == "stiffness at the tip K_m (N/m)"


def test_legends_of_charts_have_no_values(server: Any) -> None:
    """uPlot draws "--" in place of the values of its legend if the mouse is not on the chart."""
    page = LabPage(server, Lab([Elastic()]))
    assert [chart.legend["live"] for chart in page.charts] == [False] * 3


def test_controls_reach_the_model(server: Any) -> None:
    page = LabPage(server, Lab([Elastic(), Priority()]))
    page.frame(0.016)
    page.controls["share"].value = -2.0
    until(lambda: np.isclose(page.model.values["share"], 0.01))
    page.controls["stiffness"].value = 500.0
    until(lambda: page.model.values["stiffness"] == 500.0)
    for control in page.model.system.controls:
        if not isinstance(control, Choice):
            shown = 10 ** page.controls[control.name].value if control.powers else page.controls[control.name].value
            assert control.read(shown) == pytest.approx(page.model.values[control.name], rel=2e-3)
    page.gizmos["x_d"].position = (0.4, 0.4, 0.0)
    page.model.drag("x_d", [0.4, 0.4, 0.0])
    page.model.reset()
    page.frame(0.016)
    assert np.allclose(page.gizmos["x_d"].position, page.model.system.targets["x_d"])
    assert page.text.shown.startswith("running, t = ") and "real-time factor" in page.text.shown
    page.model.paused = True
    assert page.summary()[0][1].startswith("paused")
    page.model.set("joint_stiffness", 2e4)
    page.model.set("share", 1e-5)
    page.model.paused = False
    for _ in range(60):
        page.frame(0.016)
    assert page.text.shown.startswith("DIVERGED, t = ") and "turn them back and reset" in page.text.shown
    assert page.text.handle.content.startswith("**DIVERGED**")


def test_view_shows_where_its_sliders_are(server: Any) -> None:
    source = al.example_urdf("two_arms")
    arm = al.load_urdf(source)
    page = ViewPage(server, arm, source, "two_arms")
    assert np.all((page.q >= arm.limits["q_min"]) & (page.q <= arm.limits["q_max"]))
    for slider, value in zip(page.sliders, (0.2, 0.4, -0.5, -1.0, 2.0, -0.5, -0.3, 1.0), strict=True):
        slider.value = value
    page.frame()
    for frame, handle in page.scene.frames.items():
        pose = np.asarray(arm.pose(page.q, frame))
        assert np.allclose(handle.position, pose[:3, 3]) and np.allclose(handle.wxyz, of_matrix(pose[:3, :3]))
    x, y, z = arm.position(page.q, "right_hand")
    assert page.text.shown.startswith(f"right_hand at ({x:.3f}, {y:.3f}, {z:.3f}) m")
    # The displayed angles give the same rotation as the arm's pose.
    shown = re.search(r"roll, pitch, yaw = \((.+)\) rad", page.text.shown)
    assert shown is not None
    R = al.load_urdf(frame_at(shown.group(1))).pose([0.0], "tip")[:3, :3]
    # The page displays three decimals: an error of 0.0005 rad per angle.
    assert np.abs(R - arm.pose(page.q, "right_hand")[:3, :3]).max() < 2e-3


def frame_at(rpy: str) -> str:
    """Return a URDF whose frame "tip" is rotated by `rpy` (rad) relative to the base at q = 0."""
    joint = '<joint name="j" type="continuous"><parent link="base"/><child link="arm"/></joint>'
    fixed = f'<joint name="f" type="fixed"><parent link="arm"/><child link="tip"/><origin rpy="{rpy.replace(",", "")}"/></joint>'
    return f'<robot name="r"><link name="base"/><link name="arm"/><link name="tip"/>{joint}{fixed}</robot>'


@pytest.mark.parametrize("rpy", [(0.3, -0.4, 2.0), (0.0, np.pi / 2, 0.5), (0.0, -np.pi / 2, 0.5), (3.0, 1.5, -3.0), (0.0, 0.0, 0.0)])
def test_angles_of_a_rotation(rpy: tuple[float, float, float]) -> None:
    R = np.asarray(al.load_urdf(frame_at("{} {} {}".format(*rpy))).pose([0.0], "tip"))[:3, :3]
    assert np.abs(np.array(roll_pitch_yaw(R)) - rpy).max() < 1e-9


def test_the_tip_is_shown_first(server: Any) -> None:
    """The page first displays the tip of the arm, even if the last frame is fixed to the base, as in the file of the UR5."""
    source = frame_at("0 0 0").replace("</robot>", '<link name="old_base"/><joint name="g" type="fixed"><parent link="base"/>'
                                       '<child link="old_base"/></joint></robot>')  # fmt: skip
    arm = al.load_urdf(source)
    assert arm.frame_names[-1] == "old_base"
    assert ViewPage(server, arm, source, "r").text.shown.startswith("tip at ")
    assert Robot(source, "r").frame == "tip"


def test_a_slash_in_a_name_does_not_nest_links(server: Any) -> None:
    """A slash in a link name does not nest one node of the scene inside another."""
    source = al.example_urdf("planar_2r").replace('"link', '"base/link')
    page = ViewPage(server, al.load_urdf(source), source, "slashes")
    nodes = [handle.name for handle in page.scene.frames.values()]
    assert "base/link1" in page.scene.frames and len(set(nodes)) == len(nodes) and all(name.count("/") == 2 for name in nodes)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1.0, 3.0, np.pi, -np.pi / 2])
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 0.6, 0.8), (0.48, -0.6, 0.64)])
def test_quaternions(axis: tuple[float, float, float], angle: float) -> None:
    """`of_matrix` returns the quaternion of a rotation about `axis`, including half a turn."""
    k = np.cross(np.eye(3), axis)
    R = np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k
    expected = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * np.array(axis))])
    got = of_matrix(R)
    # The quaternion is an eigenvector of a 4 x 4 matrix: exact to a few roundings, with either sign.
    assert min(np.abs(got - expected).max(), np.abs(got + expected).max()) < 1e-14


def test_meshes(tmp_path: Path) -> None:
    """Drawn bodies have the right sizes, centres and axes. A sphere replaces a mesh file that cannot be read."""
    shape = between(None, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.1)
    for made, size in (
        (Shape(None, "box", (1.0, 2.0, 3.0)), (1.0, 2.0, 3.0)),
        (Shape(None, "cylinder", (0.5, 3.0)), (1.0, 1.0, 3.0)),
        (Shape(None, "sphere", (0.5,)), (1.0, 1.0, 1.0)),
        (shape, (0.2, 0.2, 1.2)),
    ):
        vertices, faces = mesh_of(made)
        assert faces.shape[1] == 3 and faces.max() < len(vertices)
        # The triangles of a sphere are inside the sphere, up to 1 % smaller.
        assert np.allclose(np.ptp(vertices, axis=0), size, rtol=0.01)
        assert np.abs(vertices.max(axis=0) + vertices.min(axis=0)).max() < 1e-12
    file = tmp_path / "one.stl"
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1000 0 0\nvertex 0 1000 0\nendloop\nendfacet\n"
    file.write_text(f"solid one\n{facet}endsolid one\n")
    vertices, faces = mesh_of(Shape(None, "mesh", (1e-3, 1e-3, 1e-3), path=str(file)))
    assert len(faces) == 1 and np.allclose(vertices.max(axis=0), [1.0, 1.0, 0.0])
    file.write_bytes(b"\0" * 30)
    vertices, _ = mesh_of(Shape(None, "mesh", (1.0, 1.0, 1.0), path=str(file)))
    assert np.ptp(vertices) < 0.05


def test_addresses() -> None:
    """An address that is in use or invalid gives an error of one line."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(al.InputError, match=rf"^lab: 127\.0\.0\.1:{port} cannot be listened at: [^\n]+$"):
            open_server("lab", "127.0.0.1", port)
    for host, port in (("no.such.host.invalid", 0), ("127.0.0.1", 70000), ("127.0.0.1", -1)):
        with pytest.raises(al.InputError, match="cannot be listened at"):
            open_server("lab", host, port)


def test_serving_ends_with_ctrl_c(server: Any, capsys: pytest.CaptureFixture[str]) -> None:
    given: list[float] = []

    def frame(seconds: float) -> None:
        given.append(seconds)
        if len(given) == 5:
            raise KeyboardInterrupt

    where = address(server)
    assert serve(server, frame, 0.01) == 0
    assert capsys.readouterr().out == f"armlet: {where} (Ctrl-C ends it)\n"
    assert where.startswith("http://127.0.0.1:") and max(given) <= 0.1


HOSTILE = (
    "<iframe srcdoc='<script>parent.hit=1</script>'></iframe>",
    "<img src=x onerror=alert(1)>",
    "[x](javascript:alert(1)) ![y](http://host/y.png) http://host www.host.org",
    "**bold** `code` # title | a | b | &lt;b&gt; \\<b> <!-- x --> $x$ ~~no~~",
    "1. one\n\n- two\n\n    code\n\n<b>\u202eover\x00\x1b[31m",
)


@pytest.mark.parametrize("name", HOSTILE)
def test_names_are_shown_and_not_obeyed(name: str) -> None:
    """A CommonMark parser reads an escaped name as one paragraph of plain text."""
    for text, strong in ((escaped(name), False), (f"**{escaped(name)}**{escaped(': ' + name)}", True)):
        tokens = MarkdownIt("gfm-like", {"linkify": False}).parse(text)
        assert [token.type for token in tokens] == ["paragraph_open", "inline", "paragraph_close"]
        kinds = {token.type for token in tokens[1].children}
        assert kinds <= {"text", "text_special"} | ({"strong_open", "strong_close"} if strong else set())
        shown = "".join(token.content for token in tokens[1].children)
        assert shown == (one_line(name) + ": " + one_line(name) if strong else one_line(name))
    assert one_line(name).isprintable()


def test_markdown_is_written_in_one_file() -> None:
    folder = Path(live.__file__).parent
    given = {path.name for path in folder.rglob("*.py") if re.search(r"add_markdown|add_html|_icon_html", path.read_text(encoding="utf-8"))}
    assert given == {"words.py"}


def answer(port: int, **headers: str) -> str:
    """Return the first line of the server's response to a websocket handshake with these headers."""
    usual = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": 22 * "A" + "=="}
    lines = [f"{name}: {value}" for name, value in ({"Host": f"127.0.0.1:{port}"} | usual | headers).items()]
    with socket.create_connection(("127.0.0.1", port), timeout=10) as asking:
        asking.sendall("\r\n".join(["GET / HTTP/1.1", *lines, "", ""]).encode())
        return asking.recv(200).decode().partition("\r\n")[0]


def test_pages_of_other_sites_are_refused(server: Any) -> None:
    port = server.get_port()
    assert refuses_strangers("127.0.0.1", port)
    own = {"Origin": f"http://127.0.0.1:{port}", "Sec-WebSocket-Protocol": f"viser-v{importlib.import_module('viser').__version__}"}
    assert answer(port, **own) == "HTTP/1.1 101 Switching Protocols"
    assert answer(port) == "HTTP/1.1 101 Switching Protocols"  # a program sends no Origin
    assert answer(port, Host=f"localhost:{port}", Origin=f"http://localhost:{port}").endswith("101 Switching Protocols")
    others = [f"http://127.0.0.1:{port + 1}", f"http://localhost:{port}", "http://127.0.0.1"]
    for origin in ("http://evil.example", "null", "file://", "x", *others):
        assert answer(port, Origin=origin) == "HTTP/1.1 403 Forbidden", origin
    # DNS of the domain evil.example may resolve to this machine, so the server refuses that host name.
    assert answer(port, Host=f"evil.example:{port}", Origin=f"http://evil.example:{port}") == "HTTP/1.1 403 Forbidden"
    assert answer(port, Host="evil.example", Upgrade="none") == "HTTP/1.1 403 Forbidden"
    assert answer(port, Upgrade="none") == "HTTP/1.1 200 OK"
    import websockets.asyncio.server as plain_server

    assert plain_server.serve.__module__ == "websockets.asyncio.server"


def test_a_server_that_accepts_other_sites_prints_a_warning(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Without its guard the server accepts pages of other sites, and prints a warning. A new version of viser may bypass the guard."""
    monkeypatch.setattr("armlet.live.server.own_pages_only", lambda host: nullcontext())
    open_page = open_server("view", "127.0.0.1", 0)
    try:
        assert "lets pages of other sites connect" in capsys.readouterr().err
    finally:
        close_server(open_page)
