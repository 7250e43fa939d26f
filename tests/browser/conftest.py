"""Chromium without a window, and what a page does in it."""

import shutil
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
WIDTHS = {"desktop": 1280, "phone": 390}


@pytest.fixture(scope="session")
def browser():
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        pytest.skip(
            f"there is no browser to look at pages with: install one of {', '.join(BROWSERS)}."
        )
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="playwright, which drives the browser, is missing."
    )
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


@pytest.fixture(scope="session")
def new_visit(browser):
    """An empty page at a width, without a network."""
    contexts = {
        width: browser.new_context(viewport={"width": pixels, "height": 900}, offline=True)
        for width, pixels in WIDTHS.items()
    }

    @contextmanager
    def new_visit(width="desktop"):
        visited = Visit(contexts[width].new_page())
        page = visited.page
        page.on("pageerror", lambda error: visited.errors.append(str(error)))
        page.on(
            "console",
            lambda text: text.type in ("error", "warning") and visited.errors.append(text.text),
        )
        page.on("request", lambda request: visited.requests.append(request.url))
        yield visited
        page.close()

    yield new_visit
    for context in contexts.values():
        context.close()


@pytest.fixture
def visit(new_visit):
    """Open a page as wide as a desktop."""
    with ExitStack() as stack:
        yield lambda path: stack.enter_context(new_visit()).open(path)
