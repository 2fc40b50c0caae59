"""A page in headless Chromium: what it shows, what it complains about, what it asks for."""

import contextlib
import functools
import shutil
from collections import namedtuple
from pathlib import Path

import pytest

# WebGL in software, so that Meshcat draws where there is no GPU; the rest without such a detour.
FLAGS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",
    "--disable-background-networking",
)
# Drawn pixels per pixel of a page: few, as software draws them. Meshcat draws nothing below 0.5.
SCALE = 0.5
# Pages get textures no larger than this, so Meshcat's shadows are coarse: they cost the most.
SMALL_TEXTURES = """
  const parameter = WebGL2RenderingContext.prototype.getParameter;
  WebGL2RenderingContext.prototype.getParameter = function (name) {
    return name === this.MAX_TEXTURE_SIZE ? 256 : parameter.call(this, name);
  };
"""
OpenPage = namedtuple("OpenPage", "page errors requests")
NAMES = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="session")
def browser():
    """Chromium, started once for all pages of a process.

    Tests are skipped where it or Playwright is missing.
    """
    playwright = pytest.importorskip("playwright.sync_api")
    chromium = next(filter(None, map(shutil.which, NAMES)), None)
    if chromium is None:
        pytest.skip("needs Chromium")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=chromium, args=list(FLAGS))
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def open_page(browser):
    """Opens a local HTML file: `with open_page(path) as (page, errors, requests)`.

    These are Playwright's page, console errors and uncaught exceptions so far, and addresses
    outside the page's own file that it asked for; all of them are refused.
    """
    return functools.partial(_open_page, browser)


@contextlib.contextmanager
def _open_page(browser, path, *, width=1280, height=800, dark=False, javascript=True):
    address = Path(path).resolve().as_uri()
    page = browser.new_page(
        viewport={"width": width, "height": height},
        color_scheme="dark" if dark else "light",
        java_script_enabled=javascript,
        device_scale_factor=SCALE,
    )
    page.add_init_script(SMALL_TEXTURES)
    errors, requests = [], []

    def answer(route) -> None:
        url = route.request.url
        if url.split("#")[0] == address or url.startswith(("data:", "blob:")):
            route.continue_()
        else:
            requests.append(url)
            route.abort()

    page.on("console", lambda m: m.type == "error" and errors.append(m.text))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("websocket", lambda socket: requests.append(socket.url))
    page.route("**/*", answer)
    try:
        page.goto(address)
        yield OpenPage(page, errors, requests)
    finally:
        page.close()
