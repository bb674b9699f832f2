"""The report of `armlet demo` in a real browser: nothing is cut off on a phone, and text has contrast in light and dark mode."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Browser
from visits import PICTURES

from armlet.demo.report import Report


@pytest.fixture
def report(tmp_path: Path) -> Path:
    made = Report(tmp_path)
    made.section("A system with a title that is as long as those of the four systems are")
    values = (0.758621, -0.517241, -1.7931, -0.896552)
    made.near("case b: v for p2 = (-5, 7) is that for p2 = (1, 1), and more of it", values, values, 1e-14, "J'F + g of the exam", "E4")
    made.bound("a claim that fails", 1.0, 0.5)
    made.draw_figure("figure", lambda figure: figure.subplots())
    return made.write_page("armlet, made up")


@pytest.mark.parametrize(("width", "scheme"), [(360, "light"), (360, "dark"), (1280, "light")])
def test_nothing_is_cut_off(browser: Browser, report: Path, width: int, scheme: str) -> None:
    page = browser.new_page(viewport={"width": width, "height": 800}, color_scheme=scheme)
    page.goto(report.as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    # Every cell is inside the window, and no text is wider than its cell.
    boxes = page.eval_on_selector_all("td", "cells => cells.map(c => [c.getBoundingClientRect().right, c.scrollWidth - c.clientWidth])")
    assert len(boxes) == 8 and all(right <= width and over <= 0 for right, over in boxes)
    # The claim takes more than 35 % of the width. On a phone it takes more than 65 %, because the values are below it.
    claim = page.locator("td.what").first.bounding_box()
    assert claim is not None and claim["width"] > 0.35 * width + (width < 600) * 0.3 * width
    text, ground = page.evaluate("[getComputedStyle(document.body).color, matchMedia('(prefers-color-scheme: dark)').matches]")
    assert ground == (scheme == "dark") and text == ("rgb(255, 255, 255)" if ground else "rgb(0, 0, 0)")
    page.screenshot(path=PICTURES / f"report_{width}_{scheme}.png", full_page=True)
    page.close()
