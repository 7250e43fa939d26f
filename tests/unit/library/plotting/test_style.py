from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from matplotlib.transforms import Bbox

from ankleloop.plotting.panels import Panel, draw_panels, estimates_figure, finish
from ankleloop.plotting.style import DataFigure, render_figure, save_figure


def test_equal_figures_give_equal_bytes_and_the_numbers_that_they_draw(tmp_path):
    data = pd.DataFrame({"time [s]": [0.0, 0.1], "torque [N·m]": [1.0, 1 / 3]})
    for name in ("first", "second"):
        figure = DataFigure(figsize=(1.0, 1.0))
        figure.subplots().plot(np.arange(5.0))
        figure.data = data
        save_figure(figure, tmp_path / name)
    for suffix in (".png", ".pdf", ".csv"):
        first, second = (tmp_path / f"{name}{suffix}" for name in ("first", "second"))
        assert first.read_bytes() == second.read_bytes()
    pd.testing.assert_frame_equal(pd.read_csv(first), data, check_exact=True)


def draw_curves(table):
    panels = {
        name: Panel(f"quantity {name} [N·m·s/rad]", "two\nlines", xlabel="frequency [Hz]", log="xy")
        for name in "abcd"
    }
    figure = draw_panels(table.assign(x=[0.1, 1, 10, 100], panel=list("abcd")), panels)
    figure.suptitle("a title of all panels")
    return finish(figure)


def draw_estimates(table):
    panels = {name: Panel(f"quantity {name} [1]") for name in "ab"}
    table = table.assign(panel=list("abab"), row="S1, a condition with a long name")
    return estimates_figure(table, panels)


@pytest.mark.parametrize("draw", [draw_curves, draw_estimates])
def test_labels_are_neither_cut_nor_upon_one_another(draw):
    values = [1e-7, 2e4, 3e-2, 4.0]
    figure = draw(pd.DataFrame({"series": ["riv", "pr-moesp"] * 2, "value": values}))
    render_figure(figure, 100.0)
    boxes = [axis.get_tightbbox() for axis in figure.axes]
    boxes += [legend.get_window_extent() for legend in figure.legends]
    boxes += [text.get_window_extent() for text in figure.texts]
    assert Bbox.union([figure.bbox, *boxes]).extents.tolist() == figure.bbox.extents.tolist()
    for one, other in combinations(boxes, 2):
        assert not one.overlaps(other)
