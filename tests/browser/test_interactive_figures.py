"""The figure of torques zooms, moves, and is switched on and off, without a network."""

import pytest

import ankleloop
from ankleloop.plotting.style import METHOD_STYLES
from ankleloop_lab.pages.interactive import render_interactive_torques
from ankleloop_lab.pages.page import render_page

MOST_BYTES = 8e6
METHODS = ("riv", "pr-moesp", "eiv-moesp", "parallel-cascade")

RANGE = "[...Bokeh.documents[0]._all_models.values()].find((model) => model.type === 'RangeTool').x_range"
WINDOW = f"() => {{ const {{ start, end }} = {RANGE}; return [start, end]; }}"
SHOWN = """(label) => [...Bokeh.documents[0]._all_models.values()]
  .filter((model) => model.type === "GlyphRenderer" && model.name === label).map((model) => model.visible)"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A page with the figure of a trial of 60 s."""
    trial = ankleloop.simulate(seed=1, duration=60.0)
    estimates = {name: ankleloop.identify(trial, name) for name in METHODS}
    html = render_interactive_torques(
        trial, estimates, METHOD_STYLES, {"start": 10.0, "length": 5.0}
    )
    path = tmp_path_factory.mktemp("page") / "trial.html"
    path.write_text(render_page("Trial", f"<h1>Trial</h1>{html}"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def opened(new_visit, path):
    with new_visit() as visited:
        yield visited.open(path)


@pytest.fixture
def page(opened, path):
    """The page, which stays open: opening it anew takes a second."""
    yield opened.page
    assert opened.errors == []
    assert opened.requests == [path.as_uri()]


def test_panels_and_strip_are_drawn_and_move_together(page, path):
    assert path.stat().st_size < MOST_BYTES
    assert page.locator("figure.interactive canvas").count() >= 4
    assert page.evaluate(WINDOW) == [10.0, 15.0]
    ranges = "() => new Set([...Bokeh.documents[0]._all_models.values()].filter(({ type }) => type === 'Figure')"
    assert (
        page.evaluate(ranges + ".map(({ x_range }) => x_range)).size") == 2
    )  # of the panels, and of the strip
    box = page.locator("figure.interactive").bounding_box()
    page.mouse.move(box["x"] + 600, box["y"] + 300)
    page.mouse.down()
    page.mouse.move(box["x"] + 400, box["y"] + 300, steps=4)
    page.mouse.up()
    start, end = page.evaluate(WINDOW)
    assert start > 10.3
    assert end - start == pytest.approx(5.0)
    page.keyboard.down("Control")
    page.mouse.wheel(0, -300)
    page.keyboard.up("Control")
    page.wait_for_function(f"() => {RANGE}.end - {RANGE}.start < 4.9")


def test_the_legend_hides_a_series_in_all_panels(page):
    assert page.evaluate(SHOWN, "riv") == [True] * 3
    assert page.evaluate(SHOWN, "eiv-moesp") == [False] * 3
    box = page.locator("figure.interactive").bounding_box()
    for row in range(4, 200, 4):  # down the first column of the legend, to its third entry
        page.mouse.click(box["x"] + 120, box["y"] + row)
        if page.evaluate(SHOWN, "riv") == [False] * 3:
            break
    assert page.evaluate(SHOWN, "riv") == [False] * 3
