import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ankleloop.plotting.panels import finish, panel_grid
from ankleloop.plotting.style import REFERENCE_LINE, DataFigure, save_figure


def entries(figure):
    """Entries of all rows of the legend."""
    return [[text.get_text() for text in legend.get_texts()] for legend in figure.legends]


def test_legend_has_each_label_once_and_marks_at_its_end():
    figure = panel_grid(2, 2, 40.0)
    for axis in figure.axes:
        axis.axhline(0.0, **REFERENCE_LINE, label="true value")
        axis.plot([0, 1], [0, 1], label="estimate")
        axis.plot([0, 1], [1, 0])  # without a label
    finish(figure)
    assert entries(figure) == [["estimate", "true value"]]


def test_a_figure_has_no_more_panels_than_are_asked_for():
    for count in (1, 3, 4, 6):
        assert len(panel_grid(count, 3, 40.0).axes) == count


def test_equal_figures_give_equal_bytes(tmp_path):
    for name in ("first", "second"):
        figure = Figure()
        figure.subplots().plot(np.arange(5.0))
        save_figure(figure, tmp_path / name)
    for suffix in (".png", ".pdf"):
        assert (tmp_path / f"first{suffix}").read_bytes() == (
            tmp_path / f"second{suffix}"
        ).read_bytes()
    assert len(list(tmp_path.iterdir())) == 4


def test_the_numbers_of_a_figure_are_written_beside_it(tmp_path):
    figure = DataFigure(figsize=(1.0, 1.0))
    figure.data = pd.DataFrame({"time [s]": [0.0, 0.1], "torque [N·m]": [1.0, 1 / 3]})
    save_figure(figure, tmp_path / "torque")
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".csv", ".pdf", ".png"]
    pd.testing.assert_frame_equal(
        pd.read_csv(tmp_path / "torque.csv"), figure.data, check_exact=True
    )
