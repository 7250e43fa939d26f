import numpy as np
import pandas as pd

from ankleloop.plotting.style import DataFigure, save_figure


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
