from io import BytesIO

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ankleloop.plotting.panels import panel_grid
from ankleloop.plotting.style import STYLE, DataFigure, render_figure, save_figure


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


def test_a_picture_is_that_of_savefig_and_leaves_the_figure_as_it_was():
    figure = panel_grid(2, 2, 40.0)
    figure.axes[0].plot([1.0, 2.0], [10.0, 2000.0])
    usual = (figure.canvas, figure.dpi)
    picture = render_figure(figure, 60)
    assert (figure.canvas, figure.dpi) == usual
    stream = BytesIO()
    with matplotlib.rc_context(STYLE):
        figure.savefig(stream, dpi=60, metadata={"Software": None})
    assert picture == stream.getvalue()


def test_the_numbers_of_a_figure_are_written_beside_it(tmp_path):
    figure = DataFigure(figsize=(1.0, 1.0))
    figure.data = pd.DataFrame({"time [s]": [0.0, 0.1], "torque [N·m]": [1.0, 1 / 3]})
    save_figure(figure, tmp_path / "torque")
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".csv", ".pdf", ".png"]
    pd.testing.assert_frame_equal(
        pd.read_csv(tmp_path / "torque.csv"), figure.data, check_exact=True
    )
