"""Results do not depend on chunks: of one point, of several, of part of the trials of a point."""

import numpy as np
import pandas as pd
import pytest

from ankleloop import evaluate, identify, simulate
from ankleloop.joint.estimate_files import load_estimates_of, save_estimates
from ankleloop.records.trial_files import load_trial_of
from ankleloop.studies.identification import identify_chunk
from ankleloop.studies.seeds import trial_entropy
from ankleloop.studies.simulation import simulate_chunk
from ankleloop.studies.study import read_studies

CONFIG = {
    "studies": {
        "small": {
            "kind": "simulation",
            "seed": 3,
            "trials": 3,
            "simulation": {"duration": 12.0},
            "points": {"reflex_gain": [10.0, 20.0], "voluntary": [0.0, 0.3]},
            "methods": {
                "pr": {"method": "pr-moesp", "options": {"basis": "rectifier"}},
                "cascade": {"method": "parallel-cascade", "options": {"max_passes": 2}},
            },
        }
    }
}
CHUNKS = {
    "a point": {},
    "several points": {"points_per_chunk": 3},
    "all points": {"points_per_chunk": 4},
    "part of the trials": {"trials_per_chunk": 2},
    "a trial": {"trials_per_chunk": 1},
}


@pytest.fixture(scope="module", params=["double", "single"])
def results(request, tmp_path_factory):
    """Files and tables of the study for each division into chunks."""

    def make(name, chunking):
        settings = CONFIG["studies"]["small"] | chunking | {"precision": request.param}
        study = read_studies({"studies": {"small": settings}})[1]["small"]
        folder = tmp_path_factory.mktemp(name.replace(" ", "-"))
        scores, parameters = [], []
        for chunk in range(len(study.chunks)):
            trials = folder / f"trials-{chunk}.nc"
            simulate_chunk(trials, "small", 3, study.simulated_points(chunk), request.param)
            found = identify_chunk(
                trials, "small", study.varied_settings(chunk), study.identified_methods, precision=request.param
            )
            save_estimates(found.estimates, folder / f"estimates-{chunk}.nc")
            scores.append(found.scores)
            parameters.append(found.parameters)
        return study, folder, pd.concat(scores, ignore_index=True), pd.concat(parameters, ignore_index=True)

    return {name: make(name, chunking) for name, chunking in CHUNKS.items()}


def in_order(table):
    """The rows in the order of a chunk for each point, whatever the chunks are."""
    key = ["point", "method", "trial", *(name for name in ("torque", "against") if name in table)]
    return table.sort_values(key).reset_index(drop=True)


@pytest.mark.parametrize("chunks", list(CHUNKS)[1:])
def test_tables_are_identical(results, chunks):
    for expected, found in zip(results["a point"][2:], results[chunks][2:], strict=True):
        pd.testing.assert_frame_equal(in_order(found), in_order(expected), check_exact=True)
        if "points" in chunks:  # then the rows have the same order, too
            pd.testing.assert_frame_equal(found, expected, check_exact=True)


def test_rows_are_ordered_by_point_method_and_trial(results):
    study, _, scores, parameters = results["all points"]
    rows = parameters[["point", "method", "trial"]].values.tolist()
    assert rows == [[point, method, k] for point in study.points for method in study.methods for k in range(3)]
    assert list(scores.columns) == [
        *("study", "point", "reflex_gain", "voluntary", "method", "trial"),
        *("torque", "against", "vaf", "low", "high"),
    ]


@pytest.mark.parametrize("chunks", CHUNKS)
def test_trials_and_estimates_are_found_in_their_files(results, chunks):
    _, folder, _, parameters = results[chunks]
    rows = parameters.set_index(["point", "method", "trial"]).sort_index()
    for point in ("reflex_gain=10.0,voluntary=0.3", "reflex_gain=20.0,voluntary=0.0"):
        trial = load_trial_of(folder.glob("trials-*.nc"), point, 2)
        assert trial.attrs["seed"] == str(np.random.SeedSequence(trial_entropy(3, "small", point, 2)))
        estimates = load_estimates_of(folder.glob("estimates-*.nc"), point, "pr")
        assert [e.stiffness["K"] for e in estimates] == rows.loc[(point, "pr"), "K"].tolist()


def test_the_library_gives_the_same_without_the_workflow(results):
    point = "reflex_gain=20.0,voluntary=0.3"
    seed = np.random.SeedSequence(trial_entropy(3, "small", point, 1))
    trial = simulate(seed=seed, duration=12.0, reflex_gain=20.0, voluntary=0.3)
    scores = results["all points"][2].query(f"point == '{point}' and trial == 1 and method == 'pr'")
    np.testing.assert_allclose(evaluate(trial, identify(trial, basis="rectifier"))["vaf"], scores["vaf"], atol=1e-5)
