"""Results do not depend on chunks, nor on what is kept; failures are rows, and lose no other result."""

import itertools
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from study_jobs import run_jobs, write_trials

from ankleloop import DataError, evaluate, identify, simulate
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.trials.trial_files import load_trial_of
from ankleloop_workflow.config.study import read_studies
from ankleloop_workflow.jobs import identification
from ankleloop_workflow.jobs.identification import identify_trials, read_trials
from ankleloop_workflow.jobs.simulation import simulate_trials, trial_entropy
from ankleloop_workflow.tables.estimate_tables import load_estimates
from ankleloop_workflow.tables.outcomes import describe_failures
from ankleloop_workflow.tables.trial_tables import read_results

SETTINGS = SimulationSettings(duration=8.0, voluntary=0.1).model_dump()
UNSTABLE = SETTINGS | {
    "reflex_gain": 30.0,
    "load_inertia": 0.1,
    "load_viscosity": 5.0,
    "load_stiffness": 100.0,
}
METHODS = {
    "pr": {"method": "pr-moesp", "options": {"basis": "rectifier"}},
    "cascade": {"method": "parallel-cascade", "options": {"max_passes": 2}},
}
STUDY = {
    "kind": "simulation",
    "notebook": None,
    "seed": 3,
    "trials": 3,
    "simulation": {"duration": 12.0},
    "points": {"reflex_gain": [20.0, 10.0], "block_rows": [12, 15]},
    "methods": METHODS,
}
KEYS = ["point", "method", "trial"]


def read_study(**changes):
    return read_studies({"studies": {"small": STUDY | changes}})[1]["small"]


CHUNKS = {
    "everything": {"precision": "single"},
    "several jobs": {"precision": "single", "trials_per_chunk": 3},
    "estimates": {"precision": "single", "keep": "estimates", "trials_per_chunk": 1},
    "scores": {"precision": "single", "keep": "scores", "trials_per_chunk": 2},
}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Files of the study for each division into chunks, and for all that may be kept."""
    folder = tmp_path_factory.mktemp("chunks")
    return {
        name: run_jobs(read_study(**changes), folder / name) for name, changes in CHUNKS.items()
    }


@pytest.mark.parametrize("chunks", list(CHUNKS)[1:])
def test_tables_do_not_depend_on_chunks_and_on_what_is_kept(results, chunks):
    """The numbers to the last bit, and the CSV file byte for byte."""
    first, other = (pd.read_parquet(results[name].table) for name in ("everything", chunks))
    pd.testing.assert_frame_equal(other, first, check_exact=True)
    first, other = (
        results[name].table.with_suffix(".csv").read_bytes() for name in ("everything", chunks)
    )
    assert other == first


def test_rows_are_ordered_by_condition_trial_point_and_method(results):
    rows = pd.read_parquet(results["several jobs"].table)[
        ["point.reflex_gain", "trial", "point.block_rows", "method"]
    ]
    assert rows.values.tolist() == [
        list(row) for row in itertools.product([20.0, 10.0], range(3), [12, 15], ["pr", "cascade"])
    ]


def test_the_library_gives_the_same_without_the_workflow(results):
    seed = np.random.SeedSequence(trial_entropy(3, "small", "reflex_gain=20.0", 1))
    trial = simulate(seed=seed, duration=12.0, reflex_gain=20.0)
    table = read_results(results["everything"].table)
    rows = table.query(
        "point == 'block_rows=15,reflex_gain=20.0' and trial == 1 and method == 'pr'"
    )
    for score in evaluate(trial, identify(trial, "pr-moesp", basis="rectifier")).itertuples():
        np.testing.assert_allclose(
            rows[f"vaf_{score.torque}_{score.against}"], [score.vaf], atol=1e-9
        )


# --- failures: rows with their reasons, and all other results


def make_conditions(**settings):
    """Conditions with a point each and three trials."""
    return {
        name: {
            "settings": values,
            "first": 0,
            "stop": 3,
            "points": {name: {"values": {}, "options": {}}},
        }
        for name, values in settings.items()
    }


TWO = make_conditions(first=SETTINGS, second=SETTINGS | {"reflex_gain": 5.0})


def run_chunk(folder, conditions=TWO, methods=METHODS, **options):
    """Simulate and identify a chunk; its rows, and the file of its estimates."""
    files = {"scores": folder / "scores.parquet", "estimates": folder / "estimates.parquet"}
    simulated = {
        name: {key: part[key] for key in ("settings", "first", "stop")}
        for name, part in conditions.items()
    }
    trials = simulate_trials("small", 3, simulated, **options)
    rows = identify_trials(trials, files, "small", conditions, methods, {}, **options).to_pandas()
    return SimpleNamespace(rows=rows, estimates=[files["estimates"]])


@pytest.fixture
def fail(monkeypatch):
    """Make the identification by a method fail at some of its calls."""

    def change(method, calls, error):
        count = itertools.count()

        def identify_or_fail(trial, name, **options):
            if name == method and next(count) in calls:
                raise error
            return identify(trial, name, **options)

        monkeypatch.setattr(identification, "identify", identify_or_fail)

    return change


ERRORS = {
    "LinAlgError: Singular matrix": np.linalg.LinAlgError("Singular matrix"),
    "the record is too short": DataError("the record is too short"),
}


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """Results of the chunk where nothing fails."""
    return run_chunk(tmp_path_factory.mktemp("expected"))


@pytest.mark.parametrize("reason", ERRORS)
def test_a_failure_is_a_row_and_loses_no_other_result(expected, fail, reason, tmp_path):
    fail("pr-moesp", {1, 5}, ERRORS[reason])
    results = run_chunk(tmp_path)
    failed = results.rows["failure"].notna()
    assert results.rows[failed][KEYS].values.tolist() == [["first", "pr", 1], ["second", "pr", 2]]
    assert (results.rows[failed]["failure"] == reason).all()
    assert results.rows[failed][["K", "vaf_net_true"]].isna().all(axis=None)
    columns = [name for name in expected.rows if name != "failure"]
    pd.testing.assert_frame_equal(results.rows[~failed][columns], expected.rows[~failed][columns])
    first, second = (
        load_estimates(results.estimates, point, "pr") for point in ("first", "second")
    )
    stiffness = expected.rows.query("method == 'pr'").set_index(["point", "trial"])["K"]
    assert {k: estimate.stiffness["K"] for k, estimate in first.items()} == {
        k: stiffness["first", k] for k in (0, 2)
    }
    assert list(second) == [0, 1]
    sentence = describe_failures(results.rows)
    counts = "2 of 12 identifications failed; means leave them out"
    assert sentence == f"{counts}. Most often: {reason}"
    assert describe_failures(expected.rows) == ""


PLACE = "study small, point first, trial 1, method pr"


def test_mistakes_in_the_program_stop_the_job(fail, tmp_path):
    fail("pr-moesp", {1}, KeyError("delay"))
    with pytest.raises(KeyError) as caught:
        run_chunk(tmp_path)
    assert caught.value.__notes__ == [PLACE]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("order", [("first", "bad", "last"), ("bad",)])
def test_an_unstable_point_becomes_failures_and_the_others_go_on(tmp_path, order):
    settings = {"first": SETTINGS, "bad": UNSTABLE, "last": SETTINGS | {"reflex_gain": 5.0}}
    conditions = make_conditions(**{name: settings[name] for name in order})
    path = tmp_path / "trials.nc"
    write_trials(path, "small", 3, conditions)
    with pytest.raises(
        DataError, match="trial 1 of the point 'bad' could not be simulated: the closed loop is"
    ):
        load_trial_of([path], "bad", 1)
    trials = read_trials(path, conditions)
    rows = identify_trials(
        trials, {"scores": tmp_path / "s.parquet"}, "small", conditions, METHODS, {}
    ).to_pandas()
    assert rows[KEYS].values.tolist() == [
        [point, m, k] for point in order for k in range(3) for m in METHODS
    ]
    assert (rows["failure"].notna() == (rows["point"] == "bad")).all()
    reason = rows.query("point == 'bad'")["failure"].iloc[0]
    assert reason.startswith("the trial could not be simulated: the closed loop is unstable")


def test_a_method_whose_options_are_the_same_identifies_a_trial_once(tmp_path, monkeypatch):
    calls = []

    def count(trial, method, **options):
        calls.append((method, options.get("block_rows")))
        return identify(trial, method, **options)

    monkeypatch.setattr(identification, "identify", count)
    rows = pd.read_parquet(
        run_jobs(read_study(points={"block_rows": [8, 10]}, trials=2), tmp_path).table
    )
    assert calls == [("pr-moesp", 8), ("parallel-cascade", None), ("pr-moesp", 10)] * 2
    stiffness = rows.pivot(index=["method", "trial"], columns="point.block_rows", values="K")
    assert (stiffness.loc["cascade", 8] == stiffness.loc["cascade", 10]).all()
    assert (stiffness.loc["pr", 8] != stiffness.loc["pr", 10]).all()


def test_a_parameter_of_the_sweep_keeps_its_column_beside_the_estimate_of_its_name(tmp_path):
    methods = {"riv": {"method": "riv", "options": {"delay": None}}}
    study = read_study(
        points={"delay": [0.03, 0.05]}, trials=1, methods=methods, simulation={"duration": 15.0}
    )
    rows = pd.read_parquet(run_jobs(study, tmp_path).table)
    assert rows["point.delay"].tolist() == [0.03, 0.05]
    np.testing.assert_allclose(rows["delay"], rows["point.delay"], atol=0.01)
    assert (rows["delay_low"] < rows["delay_high"]).all()
