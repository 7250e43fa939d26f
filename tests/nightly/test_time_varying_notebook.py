"""The notebook of joints that change in time, on small studies like those of the configuration."""

from pathlib import Path

import pandas as pd
import pytest
import yaml
from study_jobs import run_jobs, run_notebook

from ankleloop_workflow.config.study import read_studies

ROOT = Path(__file__).parents[2]
# Points in the place of those of the configuration; fewer and shorter ones.
SMALL = {
    "time-varying": [{"voluntary": 0.05, "duration": 16.8}, {"voluntary": 1.0, "duration": 14.0}],
    "square-wave": [{"voluntary": 0.05}],
    "open-loop-cycles": [{"voluntary": 0.0}],
}


@pytest.mark.usefixtures("coarse_pictures")
@pytest.mark.parametrize("name", SMALL)
def test_the_notebook_shows_every_study(tmp_path, name):
    config = yaml.safe_load((ROOT / "config" / "beyond.yaml").read_text(encoding="utf-8"))
    settings = config["studies"][name]
    settings |= {"trials": 2, "keep": "estimates", "points": SMALL[name]}
    settings["simulation"] |= {"duration": 16.8}
    study = read_studies({"studies": {name: settings}})[1][name]
    shown = run_notebook(study, run_jobs(study, tmp_path), tmp_path)
    table = pd.read_csv(tmp_path / f"{name}.csv")
    assert table["parameter"].value_counts().nunique() == 1
    assert table["error"].notna().all()
    for figure in ("errors", "trajectories"):
        assert (tmp_path / f"{name}-{figure}.csv").stat().st_size > 0
        assert (tmp_path / f"{name}-{figure}.png").stat().st_size > 0
    assert ("1.33 to 4.06 %" in shown) == (name == "open-loop-cycles")
    assert ("## How small errors can be" in shown) == (name != "square-wave")
    if name != "square-wave":
        rows = table.dropna(subset="efficiency")
        assert rows["method"].eq("riv-tv").all()
    if name == "time-varying":
        assert table[table["method"] == "riv"]["bias"].isna().all()
        assert table[table["method"] == "riv-tv"]["total"].notna().any()
