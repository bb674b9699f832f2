"""An open page in the browser: its content, positions to click, and its errors."""

from __future__ import annotations

import re
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
    """An open page and its errors."""

    page: Page
    errors: list[str] = field(default_factory=list)
    hosts: set[str] = field(default_factory=set)

    def picture(self, name: str) -> None:
        self.page.screenshot(path=PICTURES / f"{name}.png", timeout=120_000)

    def entry(self, label: str) -> Locator:
        """The field with the number of the slider that has this label. The label of a slider over powers of ten ends with its number."""
        named = re.compile(rf"^{re.escape(label)}(: \S+ = 10\^)?$")
        row = self.page.get_by_text(named).locator("xpath=ancestor::*[.//input[@type='text']][1]")
        return row.locator("input[type='text']")

    def turn(self, label: str, value: float) -> None:
        self.entry(label).fill(f"{value:g}")
        self.entry(label).press("Enter")

    def choose(self, label: str, option: str) -> None:
        self.page.get_by_label(label, exact=True).click()
        self.page.get_by_role("option", name=option, exact=True).click()

    def pixel(self, server: Any, point: NDArray[np.float64]) -> tuple[float, float]:
        """Position on the page, px, of a point of the scene, m."""
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
        """Press the mouse at `start`, move to `end` in small steps, and keep it pressed."""
        mouse = self.page.mouse
        # Without a graphics card a page draws only a few pictures per second. It finds the object under the mouse after the next picture.
        mouse.move(*start)
        time.sleep(1.0)
        mouse.down()
        time.sleep(0.5)
        mouse.move(*end, steps=12)
        time.sleep(1.0)


def until(holds: Callable[[], object], what: str, seconds: float = 60.0) -> None:
    """Wait until `holds()` is true."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, f"not within {seconds:g} s: {what}"
        time.sleep(0.05)
