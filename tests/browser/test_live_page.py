"""The page of `ankleloop live`: it moves, fits into every screen, and has a token."""

import os
import re
import subprocess
import sys
from contextlib import ExitStack
from urllib.parse import urljoin

import pytest
from conftest import WIDTHS

from ankleloop import simulate
from ankleloop_lab.files.demo_files import write_recording

WATCH = ["live", "growing.csv", "--memory", "10", "--width", "K=20%"]
# Fits that are late leave windows out, the first full one, at 10 s, among them.
ENOUGH = re.compile(r"^K within ± 20 %: yes, since 1[0-2](\.\d)? s$")
SILENCE = re.compile(r"^No samples for \d+ s\.$")
WIDTH = "() => document.documentElement.scrollWidth"


@pytest.fixture
def lines(tmp_path):
    """Lines of a table of 20 s."""
    write_recording(simulate(seed=1, duration=20.0), tmp_path / "whole.csv", "csv")
    return (tmp_path / "whole.csv").read_text().splitlines(keepends=True)


@pytest.fixture
def address(lines, tmp_path):
    """Address of the page of the first 12 s."""
    (tmp_path / "growing.csv").write_text("".join(lines[:12_001]))
    command = [sys.executable, "-u", "-m", "ankleloop", *WATCH]
    environment = os.environ | {"BROWSER": "true"}  # a program that does nothing
    with subprocess.Popen(
        command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True
    ) as live:
        words = (word for line in live.stdout for word in line.split())
        yield next(word for word in words if word.startswith("http"))
        live.kill()


def test_the_page_moves_and_only_a_browser_with_its_token_sees_it(
    browser, address, lines, tmp_path
):
    faults = []
    with ExitStack() as stack:
        pages = []
        for width in WIDTHS.values():
            size = {"width": width, "height": 900}
            context = stack.enter_context(browser.new_context(viewport=size))
            page = context.new_page()
            page.on("pageerror", lambda error: faults.append(str(error)))
            page.goto(address)
            pages.append(page)
        pictures = []
        for page in pages:
            page.get_by_text("12.0 s").wait_for()
            page.get_by_text(ENOUGH).wait_for()
            pictures.append(page.screenshot())
        with open(tmp_path / "growing.csv", "a") as file:
            file.writelines(lines[12_001:])
        for page, picture, width in zip(pages, pictures, WIDTHS.values(), strict=True):
            page.get_by_text("20.0 s").wait_for()
            assert page.screenshot() != picture
            page.get_by_text(SILENCE).wait_for()
            assert page.locator(".bk-Figure").count() == 4
            assert page.evaluate(WIDTH) <= width
    assert faults == []
    with browser.new_context() as context:
        page = context.new_page()
        for path in ("/", "/live", "/ws", "/static/js/bokeh.min.js", "/wrong/"):
            assert page.goto(urljoin(address, path)).status == 404
