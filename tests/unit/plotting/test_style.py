import struct

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from ankleloop.plotting.panels import Panel, draw_panels, finish, panel_grid
from ankleloop.plotting.style import REFERENCE_LINE, SCREEN_DOTS_PER_INCH, DataFigure, save_figure


def entries(figure):
    """Entries of all rows of the legend."""
    return [[text.get_text() for text in legend.get_texts()] for legend in figure.legends]


def test_panels_of_one_quantity_share_it_and_label_it_once_in_a_row():
    panels = {"a": Panel("VAF [%]", "net"), "b": Panel("VAF [%]", "reflex"), "c": Panel("K [N·m/rad]")}
    table = pd.DataFrame({"panel": [*"aabbcc"], "series": "riv", "x": [0, 1] * 3, "value": [0, 1, 0, 100, 0, 5]})
    figure, axes = draw_panels(table, panels)
    finish(figure)
    assert axes[0].get_ylim() == axes[1].get_ylim() != axes[2].get_ylim()
    assert [axis.get_ylabel() for axis in axes] == ["VAF [%]", "", "K [N·m/rad]"]


def test_legend_has_each_label_once_and_marks_at_its_end():
    figure, axes = panel_grid(2, 2, 40.0)
    for axis in axes:
        axis.axhline(0.0, **REFERENCE_LINE, label="true value")
        axis.plot([0, 1], [0, 1], label="estimate")
        axis.plot([0, 1], [1, 0])  # without a label
    finish(figure)
    assert entries(figure) == [["estimate", "true value"]]


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_equal_figures_give_equal_bytes(tmp_path, suffix):
    for name in ("first", "second"):
        figure = Figure()
        figure.subplots().plot(np.arange(5.0))
        save_figure(figure, tmp_path / name, suffixes=[suffix])
    first, second = ((tmp_path / f"{name}{suffix}").read_bytes() for name in ("first", "second"))
    assert first == second
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"first{suffix}", f"second{suffix}"]


def test_the_numbers_of_a_figure_are_written_beside_it(tmp_path):
    figure = DataFigure(figsize=(1.0, 1.0))
    figure.data = pd.DataFrame({"time [s]": [0.0, 0.1], "torque [N·m]": [1.0, 1 / 3]})
    save_figure(figure, tmp_path / "torque")
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".csv", ".pdf", ".png"]
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "torque.csv"), figure.data, check_exact=True)


def test_notebooks_show_figures_without_a_command():
    """As a picture, whatever the notebook has imported."""
    figure = DataFigure(figsize=(2.0, 1.0))
    figure.subplots().plot([0.0, 1.0])
    size = struct.unpack(">II", figure._repr_png_()[16:24])  # of the header
    assert size == (2 * SCREEN_DOTS_PER_INCH, SCREEN_DOTS_PER_INCH)
