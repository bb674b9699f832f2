"""A headless browser, and pages of armlet that it opens. `make test-browser` runs these tests; `make test` does not."""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, sync_playwright
from visits import PICTURES, Visit

from armlet.live.server import address, close_server

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# A message of Chromium when viser's page starts a drag: its passive event listener calls a function that needs an active one.
OF_VISER = "Unable to preventDefault inside passive event listener invocation."


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.is_relative_to(Path(__file__).parent):
            item.add_marker(pytest.mark.browser)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Start Chromium: the one that ARMLET_BROWSER names, an installed one, or playwright's."""
    found = os.environ.get("ARMLET_BROWSER") or next((path for name in NAMES if (path := shutil.which(name))), None)
    # These options enable WebGL without a graphics card.
    software = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    PICTURES.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=software)
        yield browser
        browser.close()


@pytest.fixture
def visit(browser: Browser) -> Iterator[Callable[[str], Visit]]:
    """Open an address. At the end, the page must have no errors and no content from other sites."""
    visits = []

    def go(url: str) -> Visit:
        page = browser.new_page(viewport={"width": 1280, "height": 760})
        # A page without a graphics card on a busy machine is slow.
        page.set_default_timeout(120_000)
        seen = Visit(page)
        page.on("console", lambda message: seen.errors.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: seen.errors.append(str(error)))
        page.on("request", lambda request: seen.hosts.add(request.url.removeprefix("blob:")))
        page.goto(url)
        page.locator("canvas").first.wait_for()
        visits.append((url, seen))
        return seen

    yield go
    for url, seen in visits:
        seen.page.close()
        assert [error for error in seen.errors if error != OF_VISER] == []
        assert {host for host in seen.hosts if not host.startswith((url, "data:"))} == set()


@pytest.fixture
def drawn() -> Iterator[Callable[[Any, Callable[[float], None]], str]]:
    """Return a function that draws a page in a separate thread, as `serve` does, and returns its address."""
    stop, threads, faults = threading.Event(), [], []

    def begin(server: Any, frame: Callable[[float], None]) -> str:
        def run() -> None:
            last = time.perf_counter()
            while not stop.wait(0.016):
                now = time.perf_counter()
                try:
                    frame(now - last)
                except BaseException as fault:
                    faults.append(fault)
                    raise
                last = now

        thread = threading.Thread(target=run)
        thread.start()
        threads.append((thread, server))
        return address(server)

    yield begin
    stop.set()
    for thread, server in threads:
        thread.join()
        close_server(server)
    assert faults == []
