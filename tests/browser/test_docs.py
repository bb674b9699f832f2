"""The pages of `make docs` in a real browser: a wide window in light colours, and a phone in dark ones.

On each page nothing is cut off, each formula is rendered, and text is large and has contrast. No content is from other sites.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from functools import partial
from html.parser import HTMLParser
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urldefrag, urljoin

import pytest
from playwright.sync_api import Browser, Page, Route
from visits import PICTURES, ROOT

PAGES = ROOT / "build" / "docs" / "html"
KEYS = re.findall(r"^@\w+\{([^,]+),", (ROOT / "docs" / "references.bib").read_text(), re.MULTILINE)
WINDOWS: dict[str, dict[str, Any]] = {
    "desktop": {"viewport": {"width": 1280, "height": 800}, "color_scheme": "light"},
    "phone": {
        "viewport": {"width": 390, "height": 844},
        "color_scheme": "dark",
        "device_scale_factor": 2,
        "is_mobile": True,
        "has_touch": True,
    },
}
LOOKED_AT = ("index.html", "adaptive.html", "quick_start.html", "auto_examples/gradients.html", "api/armlet.Arm.html")
LOADED = """async () => {
  for (const image of document.images) image.loading = "eager";
  if (window.MathJax && MathJax.startup) await MathJax.startup.promise;
  await document.fonts.ready;
  await Promise.all([...document.images].map(i => i.complete || new Promise(done => { i.onload = i.onerror = done; })));
}"""
# Returns the faults of the open page. The name of a fault is its kind, and the text or the file that has the fault.
FAULTS = r"""keys => {
  const faults = new Set(), width = document.documentElement.clientWidth;
  const add = (kind, what) => faults.add(kind + ": " + what.trim().slice(0, 60));
  const shown = e => {
    const box = e.getBoundingClientRect();
    return box.width > 1 && box.height > 1 && getComputedStyle(e).visibility !== "hidden";
  };
  const scrolls = e => {
    for (; e && !e.matches(".content, body"); e = e.parentElement)
      if (/auto|scroll/.test(getComputedStyle(e).overflowX) || e.matches(".sidebar-drawer, .toc-drawer")) return true;
    return false;
  };
  const numbers = color => { const c = color.match(/[\d.]+/g).map(Number); return c.length > 3 ? c : [...c, 1]; };
  const luminance = color => {
    const [r, g, b] = color.slice(0, 3).map(x => x / 255).map(x => x <= 0.03928 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ground = e => {
    for (; e; e = e.parentElement) { const c = numbers(getComputedStyle(e).backgroundColor); if (c[3] > 0.99) return c; }
    return matchMedia("(prefers-color-scheme: dark)").matches ? [18, 18, 18] : [255, 255, 255];
  };
  if (document.scrollingElement.scrollWidth > width || window.innerWidth > screen.width) add("wide", document.title);
  for (const e of document.body.querySelectorAll("*"))
    if (shown(e) && e.getBoundingClientRect().right > width + 1 && !e.matches(".toc-drawer") && !scrolls(e.parentElement))
      add("cut off", e.textContent || e.tagName);
  for (const e of document.querySelectorAll(".math")) if (!e.querySelector("mjx-container")) add("formula", e.textContent);
  for (const e of document.querySelectorAll("mjx-merror, merror, [data-mjx-error]")) add("formula", e.textContent);
  for (const image of document.images) if (!image.naturalWidth) add("image", image.src);
  const cited = new RegExp("\\[(" + keys.join("|") + ")\\b");
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let text = texts.nextNode(); text; text = texts.nextNode()) {
    const e = text.parentElement;
    if (!text.data.trim() || e.closest("script, style, noscript, mjx-container") || !shown(e)) continue;
    if (!e.closest("pre, code") && /\$|\\\(|\\\[|\\[a-z]{2}/.test(text.data)) add("formula", text.data);
    if (!e.closest("pre, code") && cited.test(text.data)) add("citation", text.data);
    const style = getComputedStyle(e), [a, b] = [numbers(style.color), ground(e)].map(luminance);
    if (parseFloat(style.fontSize) < 13.99) add("small", text.data);
    if ((Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05) < 4.5) add("faint", text.data);
  }
  return [...faults];
}"""


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: Any) -> None: ...


class Anchors(HTMLParser):
    """The links of a page, and what they may point to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.names: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {key: value for key, value in attrs if value}
        self.names |= {values[key] for key in ("id", "name") if key in values}
        self.links += [values[key] for key in ("href", "src") if key in values]


def serve(folder: Path) -> Iterator[str]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder)))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_address[1]}/"
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture(scope="module")
def site() -> Iterator[str]:
    yield from serve(PAGES)


@pytest.fixture
def made(tmp_path: Path) -> Iterator[tuple[Path, str]]:
    """A folder for a page that a test makes up, and its address."""
    for address in serve(tmp_path):
        yield tmp_path, address


def names() -> list[str]:
    found = sorted(path.relative_to(PAGES).as_posix() for path in PAGES.rglob("*.html") if "_static" not in path.parts)
    assert len(found) > 200, "make docs writes the pages"
    return found


def look(browser: Browser, address: str, pages: list[str], window: str, pictures: tuple[str, ...] = ()) -> dict[str, list[str]]:
    """The faults of each page that has some."""
    context = browser.new_context(**WINDOWS[window])
    heard: list[str] = []

    def only_from_here(route: Route) -> None:
        if route.request.url.startswith((address, "data:", "blob:")):
            route.continue_()
        else:
            heard.append(f"request: {route.request.url}")
            route.abort()

    context.route("**/*", only_from_here)
    page = context.new_page()
    page.set_default_timeout(120_000)
    page.on("console", lambda message: heard.append(f"console: {message.text}") if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: heard.append(f"console: {error}"))
    faults = {}
    for name in pages:
        heard.clear()
        page.goto(address + name)
        page.evaluate(LOADED)
        if found := page.evaluate(FAULTS, KEYS) + heard:
            faults[name] = found[:10]
        if name in pictures:
            page.screenshot(path=PICTURES / f"docs_{window}_{Path(name).stem}.png", full_page=True)
    context.close()
    return faults


@pytest.mark.parametrize("window", WINDOWS)
def test_pages_are_whole(browser: Browser, site: str, window: str) -> None:
    assert look(browser, site, names(), window, LOOKED_AT) == {}


def test_links_lead_somewhere() -> None:
    pages = {name: Anchors((PAGES / name).read_text()) for name in names()}
    lost = []
    for name, page in pages.items():
        for link in page.links:
            target, anchor = urldefrag(urljoin(f"http://here/{name}", link.split("?")[0] if "#" not in link else link))
            if not target.startswith("http://here/"):
                continue
            path = unquote(target.removeprefix("http://here/")) or "index.html"
            if not (PAGES / path).exists() or (anchor and path in pages and unquote(anchor) not in pages[path].names):
                lost.append(f"{name}: {link}")
    assert lost == []
    assert sum(len(page.links) for page in pages.values()) > 10_000


def phone(browser: Browser, url: str) -> Page:
    page = browser.new_context(**WINDOWS["phone"]).new_page()
    page.goto(url)
    return page


def test_a_thumb_reaches_every_page(browser: Browser, site: str) -> None:
    """The menu and the list of contents open by a tap, and a link there leads to its page."""
    page = phone(browser, site + "index.html")
    for menu in ("__navigation", "__toc"):
        icon = page.locator(f"label[for={menu}]:visible").first
        box = icon.bounding_box()
        assert box is not None and min(box["width"], box["height"]) >= 24
    page.locator("label[for=__navigation]:visible").first.tap()
    page.locator(".sidebar-drawer a[href='adaptive.html']").tap()
    page.wait_for_url("**/adaptive.html")
    page.locator("label[for=__toc]:visible").first.tap()
    page.locator(".toc-drawer a[href='#stability-proof']").tap()
    page.wait_for_url("**/adaptive.html#stability-proof")
    # The drawer covers the page until it is closed.
    page.wait_for_timeout(500)
    page.screenshot(path=PICTURES / "docs_phone_menu.png")
    page.context.close()


def test_paper_has_the_answers(browser: Browser, site: str) -> None:
    """On paper, closed answers are visible, and the link to the content is not."""
    page = browser.new_page()
    page.goto(site + "adaptive.html")
    answer, skip = page.locator("details p").first, page.locator(".skip-to-content")
    assert not answer.is_visible()
    page.emulate_media(media="print")
    assert answer.is_visible() and not skip.is_visible()
    page.close()


@pytest.mark.parametrize(
    ("body", "kind"),
    [
        ("<p style='width: 2000px'>long</p>", "wide"),
        ("<div style='overflow: hidden'><p style='width: 2000px'>long</p></div>", "cut off"),
        ("<p>the law $M a$</p>", "formula"),
        ("<div class='math'>\\(M a\\)</div>", "formula"),
        ("<p>a source [Hogan1985]</p>", "citation"),
        ("<p style='font-size: 13px'>small</p>", "small"),
        ("<p style='color: #999; background: #fff'>faint</p>", "faint"),
        ("<img src='nothing.png' alt=''>", "image"),
        ("<script src='http://other.invalid/a.js'></script>", "request"),
        ("<script>throw new Error('no')</script>", "console"),
    ],
)
def test_faults_are_detected(browser: Browser, made: tuple[Path, str], body: str, kind: str) -> None:
    folder, address = made
    head = "<!doctype html><meta name=viewport content='width=device-width'><link rel=icon href='data:,'><title>made up</title>"
    (folder / "a.html").write_text(f"{head}<body style='background: #fff; color: #000'>{body}")
    (folder / "b.html").write_text(f"{head}<body style='background: #fff; color: #000'><p>sound</p>")
    for window in WINDOWS:
        faults = look(browser, address, ["a.html", "b.html"], window)
        assert faults.keys() == {"a.html"} and kind in {fault.split(":")[0] for fault in faults["a.html"]}
