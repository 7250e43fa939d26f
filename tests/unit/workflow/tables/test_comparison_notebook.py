"""The notebook that compares methods."""

import numpy as np
import pandas as pd
import pytest
from study_jobs import run_jobs, run_notebook

from ankleloop_workflow.config.study import read_studies

RATES = {"fast": 100.0, "slow": 50.0}


@pytest.mark.usefixtures("coarse_pictures")
def test_the_true_pole_is_that_of_the_rate_of_each_method(tmp_path):
    methods = {
        name: {"method": "pr-moesp", "options": {"identification_rate": rate}}
        for name, rate in RATES.items()
    }
    settings = {"kind": "simulation", "notebook": "comparison", "seed": 1, "trials": 1}
    settings |= {"simulation": {"duration": 20.0}, "points": {"reflex_gain": [5.0, 13.0]}}
    study = read_studies({"studies": {"s": settings | {"methods": methods}}})[1]["s"]
    run_notebook(study, run_jobs(study, tmp_path), tmp_path)
    table = pd.read_csv(tmp_path / "s.csv").set_index("method")["spectral_radius_true"]
    for name, rate in RATES.items():
        decay = study.settings.simulation.zeta * study.settings.simulation.omega_n
        assert table[name].to_numpy() == pytest.approx(np.exp(-decay / rate))
