"""A robot file with hostile names: they are shown as text, and pages of other sites cannot connect."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import pytest
from playwright.sync_api import Browser
from visits import Visit, until

import armlet as al
from armlet.live.lab import LabPage
from armlet.live.model import Lab
from armlet.live.server import address, close_server, open_server
from armlet.live.systems import Robot
from armlet.live.view import ViewPage

Go = Callable[[str], Visit]
Draw = Callable[[Any, Callable[[float], None]], str]

# These names run a script if the page renders them: as a document, or as an attribute.
SCRIPT = "<iframe srcdoc='<script>parent.hit = 1</script>'></iframe>"
NAMES = {
    "robot": f"r{SCRIPT}",
    "base": "<img src=x onerror='window.hit = 2'>",
    "joint": f"<svg onload='window.hit = 3'></svg>{SCRIPT}",
    "link": SCRIPT,
    "title": "<b onclick='hit=4'>r&amp;b</b>",
    "mesh": f"package://{SCRIPT}/x.stl",
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    quoted = {key: quoteattr(name) for key, name in NAMES.items()}
    inertial = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
    visual = f"<visual><geometry><mesh filename={quoted['mesh']}/></geometry></visual>"
    file = tmp_path / "r&amp;b.urdf"
    file.write_text(
        f"<robot name={quoted['robot']}><link name={quoted['base']}/><link name={quoted['link']}>{inertial}{visual}</link>"
        f"<joint name={quoted['joint']} type='revolute'><parent link={quoted['base']}/><child link={quoted['link']}/>"
        "<origin xyz='0 0 0.4'/><axis xyz='0 1 0'/><limit lower='-1' upper='1'/></joint></robot>"
    )
    return file


def unharmed(seen: Visit) -> None:
    """Assert that no script ran, and that no element of the page comes from the names."""
    page = seen.page
    page.wait_for_timeout(2000.0)
    assert page.evaluate("window.hit") is None
    assert len(page.frames) == 1 and page.locator("iframe").count() == 0
    assert page.locator("img[src='x']").count() == 0 and page.locator("[onload], [onerror], [onclick]").count() == 0


def test_view_shows_hostile_names_as_text(file: Path, drawn: Draw, visit: Go) -> None:
    page = ViewPage(open_server("view", "127.0.0.1", 0), al.load_urdf(file), file, NAMES["title"])
    seen = visit(drawn(page.server, lambda _: page.frame()))
    seen.page.get_by_text(f"{SCRIPT} at (", exact=False).first.wait_for()
    seen.page.get_by_text(NAMES["title"], exact=True).wait_for()
    seen.page.get_by_text("1 meshes are not drawn", exact=False).wait_for()
    seen.page.get_by_text(NAMES["joint"], exact=True).first.wait_for()
    unharmed(seen)
    seen.picture("view_hostile")


def test_lab_shows_hostile_names_as_text(file: Path, drawn: Draw, visit: Go) -> None:
    page = LabPage(open_server("lab", "127.0.0.1", 0), Lab([Robot(file, NAMES["title"])]))
    seen = visit(drawn(page.server, page.frame))
    until(lambda: page.model.t > 1.0, "the loop runs")
    page.model.message = f"refused: {SCRIPT} **and** [more](javascript:hit=5)"
    seen.page.get_by_text(f"refused: {SCRIPT} **and** [more](javascript:hit=5)", exact=False).first.wait_for()
    # The legends of the curves contain the names of joints.
    seen.page.get_by_text(NAMES["joint"], exact=True).first.wait_for()
    unharmed(seen)
    seen.picture("lab_hostile")


@pytest.fixture
def elsewhere() -> Iterator[str]:
    """A site with a different origin on this machine."""

    class Site(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<!doctype html><title>elsewhere</title>")

        def log_message(self, *_: Any) -> None:
            pass

    site = HTTPServer(("127.0.0.1", 0), Site)
    thread = threading.Thread(target=site.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{site.server_port}"
    site.shutdown()
    thread.join()
    site.server_close()


TALK = """([url, protocol]) => new Promise(done => {
    const socket = new WebSocket(url, protocol);
    socket.onopen = () => done("open");
    socket.onerror = () => done("refused");
})"""


def test_a_page_of_another_site_cannot_connect(elsewhere: str, browser: Browser) -> None:
    import viser

    server = open_server("view", "127.0.0.1", 0)
    page = browser.new_page()
    try:
        given = [address(server).replace("http", "ws", 1), f"viser-v{viser.__version__}"]
        page.goto(elsewhere)
        assert page.evaluate(TALK, given) == "refused"
        page.goto(address(server))
        assert page.evaluate(TALK, given) == "open"
    finally:
        page.close()
        close_server(server)
