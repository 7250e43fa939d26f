"""The figure of torques zooms, moves, and is switched on and off; no peak is lost, and it is drawn in time."""

import numpy as np
import pytest

import ankleloop
from ankleloop.pages.interactive import MOST_VALUES, render_interactive_torques
from ankleloop.pages.rendering import render_page
from ankleloop.plotting.torque_series import torque_series

MOST_BYTES = 8e6
MOST_MILLISECONDS = 100.0
METHODS = ("riv", "pr-moesp", "eiv-moesp", "parallel-cascade")

DRAW = """([start, end]) => new Promise((resolve) => {
  const { range } = ankleloop.figures[0];
  const begin = performance.now();
  range.setv({ start, end });
  requestAnimationFrame(() => requestAnimationFrame(() => resolve(performance.now() - begin)));
})"""
# What a panel shows of a series: samples of a line, or the ends of bins.
SHOWN = """([number, torque]) => {
  const trace = ankleloop.figures[0].series[number].traces.find(({ plot }) => plot.name === torque);
  const { line, area } = trace;
  const { x, y } = line.data_source.data;
  const { left, right, low, high } = area.data_source.data;
  return { line: line.visible, area: area.visible, x: [...x], y: [...y], left: [...left], right: [...right],
    low: [...low], high: [...high], pixels: trace.plot.inner_width };
}"""
WINDOW = "() => { const { start, end } = ankleloop.figures[0].range; return [start, end]; }"


@pytest.fixture(scope="module")
def trial():
    return ankleloop.simulate(seed=1, duration=60.0)


@pytest.fixture(scope="module")
def estimates(trial):
    return {name: ankleloop.identify(trial, name) for name in METHODS}


@pytest.fixture(scope="module")
def path(trial, estimates, tmp_path_factory):
    """A page with the figure of a trial of 60 s."""
    html = render_interactive_torques(trial, estimates, window={"start": 10.0, "length": 5.0})
    path = tmp_path_factory.mktemp("page") / "trial.html"
    path.write_text(render_page("Trial", f"<h1>Trial</h1>{html}"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def opened(new_visit, path):
    with new_visit() as visited:
        yield visited.open(path)


@pytest.fixture
def page(opened, path):
    """The page as it is at first: opening it anew takes a second."""
    page = opened.page
    page.mouse.move(0, 0)
    page.click("button >> text=5 s")
    for number, box in enumerate(page.locator("input[data-series]").all()):
        box.set_checked(number < 4)
    page.evaluate("() => scrollTo(0, 0)")
    yield page
    assert opened.errors == []
    assert opened.requests == [path.as_uri()]


def samples_of(trial, estimates, number, torque):
    """Times and samples of a series, as the library has them."""
    trace = torque_series(trial, estimates)[number].traces[torque]
    return trace.start + np.arange(trace.low.size) * trace.step, trace.low


def test_the_figure_begins_with_the_window_of_the_static_one(page):
    assert page.evaluate(WINDOW) == [10.0, 15.0]


@pytest.mark.parametrize("torque", ["net", "intrinsic", "reflex"])
def test_a_narrow_window_shows_every_sample(page, trial, estimates, torque):
    page.evaluate(DRAW, [20.0, 22.0])
    shown = page.evaluate(SHOWN, [2, torque])
    time, samples = samples_of(trial, estimates, 2, torque)
    assert shown["line"]
    assert not shown["area"]
    inside = (time >= shown["x"][0] - 1e-6) & (time <= shown["x"][-1] + 1e-6)
    np.testing.assert_allclose(shown["x"], time[inside], atol=1e-9)
    np.testing.assert_array_equal(shown["y"], samples[inside])
    assert shown["x"][0] <= 20.0 <= 22.0 <= shown["x"][-1]


@pytest.mark.parametrize("window", [(0.0, 60.0), (7.3, 31.1)])
def test_a_wide_window_loses_no_peak(page, trial, estimates, window):
    """Every sample lies in a bin at its time, and the ends of the bins are samples, but for half a pixel."""
    page.evaluate(DRAW, window)
    shown = page.evaluate(SHOWN, [0, "net"])
    assert shown["area"]
    assert not shown["line"]
    left, right, low, high = (np.array(shown[name]) for name in ("left", "right", "low", "high"))
    assert left.size <= shown["pixels"] + 2
    time, samples = samples_of(trial, estimates, 0, "net")
    inside = (time >= window[0]) & (time <= window[1])
    time, samples = time[inside], samples[inside]
    bins = np.searchsorted(left, time + 1e-9, side="right") - 1
    assert (time <= right[bins] + 1e-9).all()
    assert (samples >= low[bins]).all()
    assert (samples <= high[bins]).all()
    margin = (high[bins] - samples).min()
    assert high.max() <= samples.max() + 2 * margin + 1e-6
    assert low.min() >= samples.min() - 2 * margin - 1e-6


def test_panels_move_together_and_buttons_show_the_whole_record(page):
    page.click("button >> text=whole record")
    start, end = page.evaluate(WINDOW)
    assert start < 1.0
    assert end > 59.0
    assert page.evaluate("() => new Set(ankleloop.figures[0].plots.map(({ x_range }) => x_range)).size") == 1
    page.click("button >> text=5 s")
    assert page.evaluate(WINDOW) == [10.0, 15.0]


def test_mouse_and_wheel_move_and_zoom(page):
    box = page.locator(".panels").bounding_box()
    page.mouse.move(box["x"] + 600, box["y"] + 120)
    page.mouse.down()
    page.mouse.move(box["x"] + 400, box["y"] + 120, steps=4)
    page.mouse.up()
    moved = page.evaluate(WINDOW)
    assert moved[0] > 10.5
    assert moved[1] - moved[0] == pytest.approx(5.0)
    page.keyboard.down("Control")
    page.mouse.wheel(0, -300)
    page.keyboard.up("Control")
    for _ in range(50):
        start, end = page.evaluate(WINDOW)
        if end - start < 4.9:
            break
        page.wait_for_timeout(20)
    assert end - start < 4.9


def test_every_series_is_switched_on_and_off(page, trial, estimates):
    series = torque_series(trial, estimates)
    boxes = page.locator("input[data-series]")
    assert boxes.count() == len(series) == 2 + 2 * len(METHODS)
    labels = page.locator(".switches label").all_inner_texts()
    assert [label.strip() for label in labels] == [item.label for item in series]
    for number, item in enumerate(series):
        for checked in (True, False):
            boxes.nth(number).set_checked(checked)
            for torque in item.traces:
                shown = page.evaluate(SHOWN, [number, torque])
                assert (shown["line"] or shown["area"]) is checked, (item.label, torque)


def test_values_at_the_pointer_are_in_the_table(page, trial, estimates):
    box = page.locator(".panels").bounding_box()
    page.mouse.move(box["x"] + 500, box["y"] + 120)
    page.wait_for_timeout(100)
    moment = float(page.locator(".switches .time").inner_text().split()[1])
    assert 10.0 < moment < 15.0
    assert "torque [N·m]" in page.locator(".switches thead").inner_text()
    for number, torque in ((0, "net"), (2, "reflex"), (6, "intrinsic")):
        time, samples = samples_of(trial, estimates, number, torque)
        cell = page.locator(f'td[data-series="{number}"][data-torque="{torque}"]').inner_text()
        assert float(cell) == pytest.approx(samples[np.argmin(abs(time - moment))], abs=6e-4)


@pytest.mark.parametrize("every_series", [False, True])
def test_a_window_is_drawn_in_time(page, every_series):
    if every_series:
        for box in page.locator("input[data-series]").all():
            box.set_checked(True)
    windows = [(0.0 + step, 60.0 - step) for step in np.linspace(0.0, 3.0, 10)]
    # The fastest, because other processes of a machine that tests may delay any of them.
    assert min(page.evaluate(DRAW, window) for window in windows) < MOST_MILLISECONDS


def test_pages_are_small(path):
    assert path.stat().st_size < MOST_BYTES


def test_a_record_of_an_hour_is_shown_by_its_peaks(visit, estimates, tmp_path, monkeypatch):
    """Fewer numbers than samples: the page says so, shows bins at every zoom, and stays small."""
    monkeypatch.setattr("ankleloop.pages.interactive.MOST_VALUES", 10_000)
    assert MOST_VALUES * 4 * 4 / 3 < MOST_BYTES / 2
    trial = ankleloop.simulate(seed=1, duration=60.0)
    html = render_interactive_torques(trial, estimates, window={"start": 10.0, "length": 5.0})
    path = tmp_path / "long.html"
    path.write_text(render_page("Long", html), encoding="utf-8")
    visited = visit(path)
    visited.page.evaluate(DRAW, [20.0, 25.0])
    shown = visited.page.evaluate(SHOWN, [0, "net"])
    assert shown["area"]
    time, samples = samples_of(trial, estimates, 0, "net")
    inside = (time >= 20.0) & (time <= 25.0)
    assert max(shown["high"]) >= samples[inside].max()
    assert min(shown["low"]) <= samples[inside].min()
    assert "least and greatest value in every" in visited.page.locator("figcaption").inner_text()
    assert visited.errors == []
