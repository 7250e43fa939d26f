import numpy as np
import pytest
from matplotlib.figure import Figure

from ankleloop.plotting.style import add_legend, panel_grid, save_figure


@pytest.mark.parametrize(("count", "size"), [(2, (6.5, 2.5)), (3, (9.5, 2.5)), (4, (9.5, 4.5))])
def test_grid_has_a_panel_for_each_and_hides_the_rest(count, size):
    figure, axes = panel_grid(count, 3, (3.0, 2.0), (0.5, 0.5))
    assert figure.get_size_inches().tolist() == list(size)
    assert axes == [axis for axis in figure.axes if axis.get_visible()]
    assert len(axes) == count


def test_legend_has_each_label_once():
    figure = Figure()
    axes = figure.subplots(1, 2)
    for axis in axes:
        axis.plot([0, 1], [0, 1], label="estimate")
        axis.plot([0, 1], [1, 0])  # without a label
    add_legend(figure, axes)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["estimate"]


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_equal_figures_give_equal_bytes(tmp_path, suffix):
    for name in ("first", "second"):
        figure = Figure()
        figure.subplots().plot(np.arange(5.0))
        save_figure(figure, tmp_path / name, suffixes=[suffix])
    first, second = ((tmp_path / f"{name}{suffix}").read_bytes() for name in ("first", "second"))
    assert first == second
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"first{suffix}", f"second{suffix}"]
