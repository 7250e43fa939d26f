"""The notebook of joints that change in time, on small studies like those of the configuration."""

import json
from pathlib import Path
from unittest import mock

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
import yaml
from study_jobs import run_jobs

from ankleloop.config.notebooks import read_notebooks
from ankleloop.config.run import report_parameters
from ankleloop.config.study import read_studies
from ankleloop.jobs.predictions import predict

NOTEBOOKS = read_notebooks()
ROOT = Path(__file__).parents[3]
# Points in the place of those of the configuration; fewer and shorter ones.
SMALL = {
    "time-varying": [{"voluntary": 0.05, "duration": 16.8}, {"voluntary": 1.0, "duration": 14.0}],
    "square-wave": [{"voluntary": 0.05}],
    "open-loop-cycles": [{"voluntary": 0.0}],
}


@pytest.fixture
def run_notebook(tmp_path):
    """Make a small study, and run the cells of the notebook on it; it gives what they show, and the table."""

    def run(name):
        config = yaml.safe_load((ROOT / "config" / "config.yaml").read_text(encoding="utf-8"))
        settings = config["studies"][name]
        settings |= {"trials": 2, "keep": "estimates", "points": SMALL[name]}
        settings["simulation"] |= {"duration": 16.8}
        study = read_studies({"studies": {name: settings}})[1][name]
        results = run_jobs(study, tmp_path)
        predictions = tmp_path / "predictions.parquet"
        predict(predictions, name, **study.prediction(NOTEBOOKS["time-varying"].predictions))
        tables = [str(results.table), str(predictions)]
        files = {"estimates": results.estimates, "tables": tables}
        stems = {
            "table_stem": str(tmp_path / name),
            "figure_stem": str(tmp_path / f"figure-{name}"),
        }
        parameters = report_parameters(
            study,
            NOTEBOOKS["time-varying"],
            files,
            published=str(ROOT / "data" / "published"),
            **stems,
        )
        return run_cells(parameters), pd.read_csv(tmp_path / f"{name}.csv"), tmp_path

    return run


def run_cells(parameters):
    """Markdown and HTML that the cells of the notebook show."""
    cells = json.loads((ROOT / "notebooks" / "time-varying.ipynb").read_text(encoding="utf-8"))[
        "cells"
    ]
    shown, names = [], {}

    def show(*outputs):
        shown.extend(str(getattr(output, "data", output)) for output in outputs)

    with plt.rc_context({"backend": "Agg"}), mock.patch("ankleloop.pages.study_page.display", show):
        for cell in (cell for cell in cells if cell["cell_type"] == "code"):
            exec("".join(cell["source"]), names)
            if "parameters" in cell["metadata"].get("tags", ()):
                assert set(parameters) <= set(names)
                names |= parameters
            names["display"] = show
    return "\n".join(shown)


@pytest.mark.usefixtures("coarse_pictures")
@pytest.mark.parametrize("name", SMALL)
def test_the_notebook_shows_every_study(run_notebook, name):
    shown, table, folder = run_notebook(name)
    assert table["parameter"].value_counts().nunique() == 1
    assert table["error"].notna().all()
    for figure in ("errors", "trajectories"):
        assert (folder / f"figure-{name}-{figure}.csv").stat().st_size > 0
        assert (folder / f"figure-{name}-{figure}.png").stat().st_size > 0
    assert ("1.33 to 4.06 %" in shown) == (name == "open-loop-cycles")
    assert ("rise time [ms]" in shown) == (name == "square-wave")
    assert table["rise"].notna().any() == (name == "square-wave")
    assert ("## How small errors can be" in shown) == (name != "square-wave")
    if name != "square-wave":
        rows = table.dropna(subset="efficiency")
        assert rows["method"].eq("riv-tv").all()
        np.testing.assert_allclose(
            rows["efficiency"], 100.0 * (rows["bound"] / rows["root_error"]) ** 2
        )
    if name == "time-varying":
        assert list(dict.fromkeys(table["point"])) == [
            "duration=16.8,voluntary=0.05",
            "duration=14.0,voluntary=1.0",
        ]
        assert "Without trajectories: riv, time-invariant." in shown
        assert table[table["method"] == "riv"]["bias"].isna().all()
        assert table[table["method"] == "riv-tv"]["total"].notna().any()
