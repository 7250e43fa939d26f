"""Chromium without a window, and what a page does in it."""

import shutil
from dataclasses import dataclass, field
from pathlib import Path

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
SCREENSHOTS = Path(__file__).parents[2] / "results" / "screenshots"  # of the last run, for looking at
WIDTHS = {"desktop": 1280, "phone": 390}


@pytest.fixture(scope="session")
def browser():
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        pytest.skip(f"there is no browser to look at pages with: install one of {', '.join(BROWSERS)}.")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright, which drives the browser, is missing.")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield browser
        browser.close()


@dataclass
class Visit:
    """A page in the browser, with what it said and asked for."""

    page: object
    errors: list = field(default_factory=list)
    requests: list = field(default_factory=list)

    def open(self, path):
        self.page.goto(Path(path).as_uri())
        if self.page.locator("figure.interactive").count():
            self.page.wait_for_selector("body.interactive", timeout=60_000)
        return self


@pytest.fixture
def visit(browser):
    """Open a page at a width, without a network."""
    contexts = []

    def visit(path, width="desktop"):
        context = browser.new_context(viewport={"width": WIDTHS[width], "height": 900}, offline=True)
        contexts.append(context)
        result = Visit(context.new_page())
        result.page.on("pageerror", lambda error: result.errors.append(str(error)))
        result.page.on("console", lambda text: text.type in ("error", "warning") and result.errors.append(text.text))
        result.page.on("request", lambda request: result.requests.append(request.url))
        return result.open(path)

    yield visit
    for context in contexts:
        context.close()


@pytest.fixture(scope="session")
def keep_screenshot():
    """Keep a picture of a page under results/screenshots."""
    shutil.rmtree(SCREENSHOTS, ignore_errors=True)
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)

    def keep(page, name):
        page.screenshot(path=SCREENSHOTS / f"{name}.jpg", full_page=True, type="jpeg", quality=70)

    return keep
