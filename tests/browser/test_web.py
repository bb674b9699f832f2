"""Pages of `armlet.export_web` in a real browser, opened as files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from playwright.sync_api import Browser, Page
from visits import PICTURES

import armlet as al

TWO, SEVEN = models.TWO_LINKS, models.SEVEN_AXES


def two_links(folder: Path) -> Path:
    law = al.PDGravity(TWO, [0.4, 0.9], kp=20.0, kd=2.0)
    return al.export_web((al.RigidArm(TWO), law), folder / "two.html", {"law.kp": (1.0, 100.0), "q0[0]": (-1.0, 1.0)}, q0=[0.0, 0.1])


def seven_axes(folder: Path) -> Path:
    q = np.array([0.3, 0.5, -0.2, -0.9, 0.4, 1.6, 0.2])
    target = SEVEN.position(q, SEVEN.tip_frame)
    law = al.CartesianImpedance(SEVEN, target, 300.0, 40.0, frame=SEVEN.tip_frame, nullspace=al.NullSpace(q, 20.0, 5.0))
    return al.export_web((al.RigidArm(SEVEN), law), folder / "seven.html", {"law.stiffness": (50.0, 600.0)}, q0=q)


@pytest.fixture
def opened(browser: Browser) -> Any:
    """Open a page of this width. At the end, it must have no messages and no requests."""
    pages: list[tuple[Page, list[str]]] = []

    def go(path: Path, width: int = 1280, scheme: Any = "light") -> Page:
        page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
        page.set_default_timeout(120_000)
        seen: list[str] = []
        page.on("console", lambda message: seen.append(message.text))
        page.on("pageerror", lambda error: seen.append(str(error)))
        page.on("request", lambda request: seen.append(request.url) if request.url != path.as_uri() else None)
        page.goto(path.as_uri())
        page.wait_for_function("window.armlet && armlet.loop.t > 0.5")
        pages.append((page, seen))
        return page

    yield go
    for page, seen in pages:
        page.close()
        assert seen == []


def state(page: Page) -> list[float]:
    q: list[float] = page.evaluate("[...armlet.loop.group('state')]")
    return q


def test_a_slider_changes_the_curve(opened: Any, tmp_path: Path) -> None:
    """The page computes the run of `simulate` until a slider changes the gain. A small gain moves the arm slowly to its target."""
    page = opened(two_links(tmp_path))
    page.get_by_role("button", name="Pause").click()
    rows = page.evaluate("armlet.rows.map(row => [row.t, ...row.q])")
    law = al.PDGravity(TWO, [0.4, 0.9], kp=20.0, kd=2.0)
    run = al.simulate(al.RigidArm(TWO), law, [0.0, 0.1], t_end=max(rows[-1][0], 1e-3), dt=1e-3)
    for t, *q in rows:
        np.testing.assert_allclose(q, run.q[round(t / 1e-3)], rtol=1e-9, atol=1e-12)
    slider = page.get_by_label("position gain")
    slider.focus()
    page.keyboard.press("Home")
    assert slider.get_attribute("aria-valuetext") == "1 N m/rad"
    page.get_by_label("target of joint1").fill("1.5")
    page.get_by_role("button", name="Play").click()
    before = page.evaluate("armlet.loop.t")
    page.wait_for_function(f"armlet.loop.t > {before} + 1")
    slow = state(page)[0]
    page.evaluate("document.querySelector('input').value = 100; document.querySelector('input').oninput()")
    page.wait_for_function(f"armlet.loop.t > {before} + 3")
    assert slow < 1.2 and abs(state(page)[0] - 1.5) < 0.1
    page.get_by_label("initial position of joint1").fill("100")
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Reset").click()
    assert state(page)[:2] == [1.0, 0.1] and page.evaluate("armlet.loop.t") == 0.0


def test_the_target_is_dragged(opened: Any, tmp_path: Path) -> None:
    page = opened(seven_axes(tmp_path))
    at = page.evaluate("""() => {
        const canvas = document.querySelector("canvas.arm"), box = canvas.getBoundingClientRect();
        const lines = armlet.loop.lines(), [x, y] = armlet.picture.pixel(armlet.picture.targetPoint(lines, data.targets[0]));
        return [box.x + x, box.y + y];
    }""")
    page.mouse.move(*at)
    page.mouse.down()
    page.mouse.move(at[0], at[1] + 15, steps=4)
    page.mouse.up()
    page.wait_for_timeout(2000)
    target = page.evaluate("[0, 1, 2].map(i => armlet.loop.target(i))")
    reached = SEVEN.position(np.array(state(page)[:7]), SEVEN.tip_frame)
    start = SEVEN.position(np.array([0.3, 0.5, -0.2, -0.9, 0.4, 1.6, 0.2]), SEVEN.tip_frame)
    assert target[2] < start[2] - 0.02 and np.linalg.norm(reached - target) < 0.02
    view = page.evaluate("armlet.picture.view[0]")
    page.locator("canvas.arm").focus()
    page.keyboard.press("ArrowRight")
    assert page.evaluate("armlet.picture.view[0]") > view


def test_a_state_that_is_not_finite_stops_the_page(opened: Any, tmp_path: Path) -> None:
    page = opened(two_links(tmp_path))
    page.evaluate("armlet.loop.group('state')[0] = NaN")
    page.get_by_text("Stopped at t =").wait_for()
    page.get_by_role("button", name="Play").click()
    page.wait_for_function("armlet.loop.t > 0.1")
    assert np.isfinite(state(page)).all() and page.get_by_role("alert").inner_text() == ""


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (390, "dark")])
def test_nothing_is_cut_off(opened: Any, tmp_path: Path, width: int, scheme: str) -> None:
    for make in (two_links, seven_axes):
        page = opened(make(tmp_path), width, scheme)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        boxes = page.eval_on_selector_all("label, output, button, canvas", "all => all.map(e => e.getBoundingClientRect().right)")
        assert max(boxes) <= width
        assert page.eval_on_selector_all("canvas", "all => all.every(e => e.getAttribute('aria-label'))")
        assert page.eval_on_selector_all("input", "all => all.every(e => e.labels.length === 1)")
        page.screenshot(path=PICTURES / f"web_{make.__name__}_{width}.png", full_page=True)
