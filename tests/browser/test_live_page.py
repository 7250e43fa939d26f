"""The page of `ankleloop live`: it moves, fits into every screen, and has a token."""

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from urllib.parse import urljoin

import pytest
from conftest import WIDTHS

from ankleloop import LiveEstimate, simulate
from ankleloop.pages.live import LiveView

WIDTH = "() => document.documentElement.scrollWidth"


@pytest.mark.parametrize("pixels", WIDTHS.values(), ids=WIDTHS)
def test_the_page_moves_and_only_a_browser_with_its_token_sees_it(browser, pixels):
    trial = simulate(seed=1, duration=20.0)
    live = LiveEstimate(1000.0, memory=10.0, every=1.0, beside=False)
    source = SimpleNamespace(silence=0.0)
    view = LiveView(source, live, {"K": 0.2})

    def add(start, stop):
        part = trial.isel(time=slice(start, stop))
        live.add(part["position"], part["torque"], part["reference"])

    add(0, 12_000)
    with ThreadPoolExecutor(1) as pool:  # the browser has the event loop of this thread
        address = pool.submit(view.serve).result()
    with browser.new_context(viewport={"width": pixels, "height": 900}) as context:
        page = context.new_page()
        faults = []
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.goto(address)
        page.get_by_text("K within ± 20 %: yes, since 10 s").wait_for()
        before = page.screenshot()
        add(12_000, 20_000)
        page.get_by_text("20.0 s").wait_for()
        assert page.screenshot() != before
        source.silence = 7.0
        page.get_by_text("No samples for 7 s").wait_for()
        assert page.locator(".bk-Figure").count() == 4
        assert page.evaluate(WIDTH) <= pixels
        assert faults == []
    with browser.new_context() as context:
        page = context.new_page()
        for path in ("/", "/live", "/ws", "/static/js/bokeh.min.js", "/wrong/"):
            assert page.goto(urljoin(address, path)).status == 404
