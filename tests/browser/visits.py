"""A page that is open: what it shows, where to click, what it has complained about."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from playwright.sync_api import Locator, Page

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "build" / "browser"


@dataclass
class Visit:
    """A page that is open, and what it has complained about."""

    page: Page
    errors: list[str] = field(default_factory=list)
    hosts: set[str] = field(default_factory=set)

    def picture(self, name: str) -> None:
        self.page.screenshot(path=PICTURES / f"{name}.png")

    def entry(self, label: str) -> Locator:
        """The number beside the slider with this label."""
        row = self.page.get_by_text(label, exact=True).locator("xpath=ancestor::*[.//input[@type='text']][1]")
        return row.locator("input[type='text']")

    def turn(self, label: str, value: float) -> None:
        self.entry(label).fill(f"{value:g}")
        self.entry(label).press("Enter")

    def choose(self, label: str, option: str) -> None:
        self.page.get_by_label(label, exact=True).click()
        self.page.get_by_role("option", name=option, exact=True).click()

    def pixel(self, server: Any, point: NDArray[np.float64]) -> tuple[float, float]:
        """Where a point of the scene, m, is on the page, px."""
        (client,) = server.get_clients().values()
        camera = client.camera
        forward = camera.look_at - camera.position
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, camera.up_direction)
        right /= np.linalg.norm(right)
        across = point - camera.position
        depth, x, y = across @ forward, across @ right, across @ np.cross(right, forward)
        box = self.page.locator("canvas").first.bounding_box()
        assert box is not None and depth > 0
        scale = 0.5 * box["height"] / np.tan(0.5 * camera.fov) / depth
        return box["x"] + 0.5 * box["width"] + scale * x, box["y"] + 0.5 * box["height"] - scale * y

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Press, move in small steps, and hold."""
        mouse = self.page.mouse
        # Without a graphics card a page draws a few pictures per second: what is under the mouse is known after the next one.
        mouse.move(*start)
        time.sleep(1.0)
        mouse.down()
        time.sleep(0.5)
        mouse.move(*end, steps=12)
        time.sleep(1.0)


def until(holds: Callable[[], object], what: str, seconds: float = 20.0) -> None:
    """Wait until something holds."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, f"not within {seconds:g} s: {what}"
        time.sleep(0.05)
