"""Pages of `al.export_web` in headless Chromium: pictures per second, and the speed of the loop relative to real time.

Run: `python benches/web_pages.py`, with the packages of `requirements/browser.txt`. The program ARMLET_BROWSER is the browser; without it,
`chromium` on PATH.

The result of each page is checked first: after the measurement, its positions agree with `al.simulate` within 1e-9. *Reserve* is the
largest possible speed of the loop: the simulated time of all steps divided by their computing time, without drawing.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import Browser, sync_playwright

import armlet as al

SECONDS = 5
ROUNDS = 3
SEVEN = al.load_urdf(al.example_urdf("seven_axis"))
START = np.array([0.3, 0.5, -0.2, -0.9, 0.4, 1.6, 0.2])
FOUR = al.planar_arm([1.0, 1.0, 0.25, 0.25])
PICTURES = """seconds => new Promise(done => {
    let [count, begin] = [0, performance.now()];
    const next = now => {
        count += 1;
        if (now - begin < 1000 * seconds) requestAnimationFrame(next);
        else done([1000 * (count - 1) / (now - begin), armlet.capacity]);
    };
    requestAnimationFrame(now => { begin = now; count = 1; requestAnimationFrame(next); });
})"""


def pages() -> dict[str, tuple[Any, Any, dict[str, Any]]]:
    """For each case: a plant, a law, and the options of its page."""
    target = np.add(SEVEN.position(START, "tcp"), [0.1, 0.0, -0.1])
    impedance = al.CartesianImpedance(SEVEN, target, 300.0, 40.0, frame="tcp", nullspace=al.NullSpace(START, 20.0, 5.0))
    tip = [al.Task("tcp", "xyz", target, 2.0), al.PostureTask(START, 1.0)]
    two = [al.Task("link4", "xy", [1.2, 0.9], 4.0), al.Task("link2", "xy", [1.9, 0.3], 4.0)]
    return {
        "impedance, seven axes": (al.RigidArm(SEVEN), impedance, {"q0": START}),
        "task priority, seven axes": (al.VelocityArm(SEVEN), al.PriorityVelocity(SEVEN, tip), {"q0": START}),
        "task priority, 4R, at a singularity": (al.VelocityArm(FOUR), al.PriorityVelocity(FOUR, two), {"q0": [0.9, -1.2, 0.6, 0.7]}),
    }


def measure(browser: Browser, path: Path, loop: tuple[Any, Any, dict[str, Any]]) -> tuple[float, float]:
    """The median of pictures per second, and of the reserve. The positions of the page must be those of `simulate`."""
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    page.goto(path.as_uri())
    page.wait_for_function("window.armlet && armlet.capacity > 0")
    found = [page.evaluate(PICTURES, SECONDS) for _ in range(ROUNDS)]
    page.get_by_role("button", name="Pause").click()
    k, q = page.evaluate("[armlet.loop.k, [...armlet.loop.group('state').subarray(0, JOINTS)]]")
    page.close()
    plant, law, options = loop
    run = al.simulate(plant, law, t_end=k * 1e-3, dt=1e-3, record_every=k, **options)
    np.testing.assert_allclose(q, run.q[-1], rtol=1e-9, atol=1e-9)
    rate, reserve = np.median(found, axis=0)
    return float(rate), float(reserve)


def main() -> None:
    found = os.environ.get("ARMLET_BROWSER") or shutil.which("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found)
        print(f"Chromium {browser.version}\n\n| page | size, kB | pictures per second | reserve, times real time |\n|---|---:|---:|---:|")
        for name, loop in pages().items():
            plant, law, options = loop
            path = al.export_web((plant, law), Path(folder) / "page.html", **options)
            rate, reserve = measure(browser, path, loop)
            print(f"| {name} | {path.stat().st_size / 1000:.0f} | {rate:.0f} | {reserve:.0f} |")


if __name__ == "__main__":
    main()
