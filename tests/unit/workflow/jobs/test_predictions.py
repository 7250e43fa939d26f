"""Predictions are those of the library, by point, kind and seed; what cannot be predicted is named."""

from typing import get_args

import numpy as np
import pandas as pd
import pytest

from ankleloop import (
    cramer_rao,
    identify,
    plan_duration,
    simulate,
    trajectory_bound,
)
from ankleloop.simulation.settings import SimulationSettings
from ankleloop_workflow.config.notebooks import Prediction
from ankleloop_workflow.jobs.predictions import PREDICTIONS, predict

SETTINGS = SimulationSettings(duration=15.0, voluntary=0.1).model_dump()
LOAD = {"load_inertia": 0.1, "load_viscosity": 5.0, "load_stiffness": 100.0}
UNSTABLE = LOAD | {"reflex_gain": 30.0}
CYCLIC = SETTINGS | {"variation": "cycle", "stiffness_variation": 0.4}


@pytest.fixture
def predicted(tmp_path):
    """Predictions for points as a table."""

    def run(points, **draws):
        path = tmp_path / "predictions.parquet"
        kinds = {name.replace("_", " "): count for name, count in draws.items()}
        predict(path, "small", points, kinds)
        return pd.read_parquet(path)

    return run


def test_the_list_of_notebooks_knows_every_kind():
    assert set(get_args(Prediction)) == set(PREDICTIONS)


def test_bounds_are_those_of_the_library_to_the_last_bit(predicted):
    points = {"low": SETTINGS, "high": SETTINGS | {"reflex_gain": 20.0}}
    table = predicted(points, known_delay=2, unknown_delay=1, reference_alone=1)
    assert len(table) == 2 * (2 + 1 + 1)
    rows = table.set_index(["point", "kind", "seed"])
    options = {
        ("known delay", 0): {},
        ("known delay", 1): {},
        ("unknown delay", 0): {"known_delay": False},
        ("reference alone", 0): {"fed_back": False},
    }
    for point, settings in points.items():
        for (kind, seed), chosen in options.items():
            bound = cramer_rao(seed=seed, **chosen, **settings)
            assert rows.loc[(point, kind, seed)].dropna().to_dict() == bound


def test_bounds_of_trajectories_are_means_over_their_places_and_steps_have_none(predicted):
    points = {"steps": CYCLIC | {"variation_shape": "square"}, "smooth": CYCLIC}
    table = predicted(points, trajectories=1)
    (row,) = table.to_dict("records")
    assert row["point"] == "smooth"
    bound = trajectory_bound(seed=0, **CYCLIC)
    assert row["K"] == float(np.sqrt((bound["K"] ** 2).mean()))
    assert row["K_mean"] == float(bound["K_mean"])
    assert row["K_truth"] == pytest.approx(150.0, rel=0.1)
    del points["smooth"]
    assert list(predicted(points, trajectories=1)) == ["point", "kind", "seed"]


def test_durations_are_planned_from_pilots_with_the_usual_perturbation(predicted):
    points = {"usual": SETTINGS, "fast": SETTINGS | {"switching_interval": 0.05}}
    table = predicted(points, pilots=2)
    assert table[["point", "seed"]].values.tolist() == [["usual", 0], ["usual", 1]]
    for row in table.itertuples():
        trial = simulate(seed=row.seed, **SETTINGS | {"duration": row.pilot})
        pilot = identify(trial, "riv", delay=0.04)
        assert row.planned == plan_duration(pilot, {"K": row.width}).needed["K"]


def test_a_point_that_cannot_be_simulated_has_a_row_without_numbers(predicted, caplog):
    table = predicted({"good": SETTINGS, "bad": SETTINGS | UNSTABLE}, pilots=1).set_index("point")
    assert table["planned"].notna().to_dict() == {"good": True, "bad": False}
    assert "study small, point bad, pilots, seed 0: there is none: the closed loop" in caplog.text
