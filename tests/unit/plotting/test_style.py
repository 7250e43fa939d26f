import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ankleloop.plotting.style import DataFigure, save_figure


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
