"""Results do not depend on chunks: of one point, of several, of part of the trials of a point."""

import itertools
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from ankleloop import DataError, UnstableLoopError, evaluate, identify, simulate
from ankleloop.joint.estimate_files import load_estimates
from ankleloop.paper.results import read_results
from ankleloop.paper.trial_counts import describe_failures
from ankleloop.simulation import simulate as simulation
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.identification import identify_chunk
from ankleloop.studies.seeds import trial_entropy
from ankleloop.studies.simulation import simulate_chunk
from ankleloop.studies.study import read_studies
from ankleloop.trials.trial_files import load_chunks, load_trial_of

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
    "part of the trials": {"trials_per_chunk": 2},
}


def identify_to(folder, path, study, points, methods, name="0", **options):
    """Identify a chunk; it gives the tables, as they are in their files, and the path of the estimates."""
    files = {"estimates": folder / f"estimates-{name}.parquet"}
    files |= {table: folder / f"{table}-{name}.csv" for table in ("scores", "parameters")}
    identify_chunk(path, files, study, points, methods, **options)
    tables = {table: pd.read_csv(files[table], dtype={"warnings": object}) for table in ("scores", "parameters")}
    return SimpleNamespace(**tables, estimates=files["estimates"])


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Files and tables of the study for each division into chunks."""

    def make(name, chunking):
        settings = CONFIG["studies"]["small"] | chunking
        study = read_studies({"studies": {"small": settings}})[1]["small"]
        folder = tmp_path_factory.mktemp(name.replace(" ", "-"))
        scores, parameters = [], []
        files = [folder / f"trials-{number}.nc" for number in range(len(study.trial_chunks))]
        for number, path in enumerate(files):
            simulate_chunk(path, "small", 3, study.simulated_points(number, stored=True), study.settings.precision)
        for chunk in range(len(study.chunks)):
            points, methods = study.identified_points(chunk), study.identified_methods
            part = study.identified_trials(chunk)
            path = files[study.trial_chunk_of(chunk)]
            precision = study.settings.precision
            tables = identify_to(folder, path, "small", points, methods, chunk, trials=part, precision=precision)
            scores.append(tables.scores)
            parameters.append(tables.parameters)
        return study, folder, pd.concat(scores, ignore_index=True), pd.concat(parameters, ignore_index=True)

    return {name: make(name, chunking) for name, chunking in CHUNKS.items()}


def in_order(table):
    """The rows in the order of a chunk for each point, whatever the chunks are."""
    key = ["point", "method", "trial", *(name for name in ("torque", "against") if name in table)]
    return table.sort_values(key).reset_index(drop=True)


@pytest.mark.parametrize("chunks", list(CHUNKS)[1:])
def test_tables_are_identical(results, chunks):
    for expected, table in zip(results["a point"][2:], results[chunks][2:], strict=True):
        pd.testing.assert_frame_equal(in_order(table), in_order(expected), check_exact=True)
        if "points" in chunks:  # then the rows have the same order, too
            pd.testing.assert_frame_equal(table, expected, check_exact=True)


def test_rows_are_ordered_by_point_method_and_trial(results):
    study, _, scores, parameters = results["several points"]
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
        estimates = load_estimates(folder.glob("estimates-*.parquet"), point, "pr")
        assert [e.stiffness["K"] for e in estimates.values()] == rows.loc[(point, "pr"), "K"].tolist()


def test_the_library_gives_the_same_without_the_workflow(results):
    point = "reflex_gain=20.0,voluntary=0.3"
    seed = np.random.SeedSequence(trial_entropy(3, "small", point, 1))
    trial = simulate(seed=seed, duration=12.0, reflex_gain=20.0, voluntary=0.3)
    scores = results["several points"][2].query(f"point == '{point}' and trial == 1 and method == 'pr'")
    np.testing.assert_allclose(
        evaluate(trial, identify(trial, "pr-moesp", basis="rectifier"))["vaf"], scores["vaf"], atol=1e-5
    )


# --- failures: rows with their reasons, and all other results


@pytest.fixture(scope="module")
def chunk(tmp_path_factory):
    """A trial file of two points with three trials each, and what `identify_chunk` takes."""
    study = read_studies(CONFIG)[1]["small"]
    points = {point.name: {point.name: {"values": point.values, "options": {}}} for point in study.point_list[:2]}
    path = tmp_path_factory.mktemp("failures") / "trials.nc"
    simulate_chunk(path, "small", 3, {name: {"settings": study.points[name], "first": 0, "stop": 3} for name in points})
    return path, "small", points, study.identified_methods


@pytest.fixture
def fail(monkeypatch):
    """Make the identification by a method fail at some of its calls."""

    def change(method, calls, error):
        count = itertools.count()

        def identify_or_fail(trial, name, **options):
            if name == method and next(count) in calls:
                raise error
            return identify(trial, name, **options)

        monkeypatch.setattr("ankleloop.studies.identification.identify", identify_or_fail)

    return change


ERRORS = {
    "LinAlgError: Singular matrix": np.linalg.LinAlgError("Singular matrix"),
    "ValueError: array must not contain infs or NaNs": ValueError("array must not contain infs or NaNs"),
    "the record is too short": DataError("the record is too short"),
}


@pytest.fixture(scope="module")
def expected(chunk, tmp_path_factory):
    """Results of the chunk where nothing fails."""
    return identify_to(tmp_path_factory.mktemp("expected"), *chunk)


@pytest.mark.parametrize("reason", ERRORS)
def test_a_failure_is_a_row_and_loses_no_other_result(chunk, expected, fail, reason, tmp_path):
    fail("pr-moesp", {1, 5}, ERRORS[reason])
    results = identify_to(tmp_path, *chunk)
    rows = results.parameters
    failed = rows["failure"].notna()
    points = list(chunk[2])
    assert rows[failed][["point", "method", "trial"]].values.tolist() == [[points[0], "pr", 1], [points[1], "pr", 2]]
    assert (rows[failed]["failure"] == reason).all()
    assert rows[failed][["K", "B", "I", "G"]].isna().all(axis=None)
    key = ["point", "method", "trial"]
    assert rows[key].equals(expected.parameters[key])
    pd.testing.assert_frame_equal(rows[~failed][expected.parameters.columns], expected.parameters[~failed])
    scores = expected.scores.merge(rows[~failed][key], on=key)
    pd.testing.assert_frame_equal(results.scores, scores)
    counts = {
        name: sum(len(load_estimates([results.estimates], point, name)) for point in points)
        for name in ("pr", "cascade")
    }
    assert counts == {"pr": 4, "cascade": 6}
    sentence = describe_failures(rows)
    assert sentence.startswith("2 of 12 identifications failed; means leave them out. ")
    assert f"2 of them, such as pr at {points[0]}: {reason.rstrip('.')}" in sentence
    assert describe_failures(expected.parameters) == ""


def test_estimates_keep_the_number_of_their_trial(chunk, expected, fail, tmp_path):
    """The second estimate of a method that failed on trial 1 is that of trial 2."""
    stiffness = expected.parameters.query("method == 'pr'").set_index(["point", "trial"])["K"]
    fail("pr-moesp", {1}, ERRORS["the record is too short"])
    results = identify_to(tmp_path, *chunk)
    first, second = chunk[2]
    estimates = load_estimates([results.estimates], first, "pr")
    assert {number: estimate.stiffness["K"] for number, estimate in estimates.items()} == {
        number: stiffness[first, number] for number in (0, 2)
    }
    assert list(load_estimates([results.estimates], second, "pr")) == [0, 1, 2]


def test_estimates_that_cannot_be_scored_are_failures(chunk, monkeypatch, tmp_path):
    def refuse(*_, **__):
        raise DataError("nothing is left to score")

    monkeypatch.setattr("ankleloop.studies.identification.score_rows", refuse)
    results = identify_to(tmp_path, *chunk)
    assert (results.parameters["failure"] == "nothing is left to score").all()
    assert load_estimates([results.estimates], next(iter(chunk[2])), "pr") == {}


def test_a_chunk_in_which_all_fails_has_rows_and_no_scores(chunk, expected, fail, tmp_path):
    path, study, points, methods = chunk
    fail("pr-moesp", range(6), ERRORS["the record is too short"])
    results = identify_to(tmp_path, path, study, points, {"pr": methods["pr"]})
    assert (results.parameters["failure"] == "the record is too short").all()
    assert len(results.parameters) == 6
    empty = read_results([tmp_path / "scores-0.csv"])
    assert list(empty.columns) == list(expected.scores.columns)
    assert len(empty) == 0
    assert load_estimates([results.estimates], next(iter(points)), "pr") == {}


def test_estimates_of_other_chunks_are_read_where_a_method_failed_in_one(chunk, expected, fail, tmp_path):
    fail("pr-moesp", range(6), ERRORS["the record is too short"])
    results = identify_to(tmp_path, *chunk)
    estimates = load_estimates([results.estimates, expected.estimates], next(iter(chunk[2])), "pr")
    assert len(estimates) == 3


PLACE = "study small, point reflex_gain=10.0,voluntary=0.0, trial 1, method pr"


@pytest.mark.parametrize("error", [TypeError("no such option"), KeyError("delay"), AttributeError("torque")])
def test_mistakes_in_the_program_stop_the_job(chunk, fail, error, tmp_path):
    fail("pr-moesp", {1}, error)
    with pytest.raises(type(error)) as caught:
        identify_to(tmp_path, *chunk)
    assert caught.value.__notes__ == [PLACE, str(chunk[0])]
    assert not list(tmp_path.iterdir())


def test_failures_can_stop_the_job(chunk, fail, tmp_path):
    fail("pr-moesp", {1}, np.linalg.LinAlgError("Singular matrix"))
    with pytest.raises(np.linalg.LinAlgError) as caught:
        identify_to(tmp_path, *chunk, failures="stop")
    assert caught.value.__notes__ == [PLACE, str(chunk[0])]


# --- trials that cannot be simulated

STABLE = SimulationSettings(duration=8.0).model_dump()
UNSTABLE = STABLE | {"reflex_gain": 30.0, "load_inertia": 0.1, "load_viscosity": 5.0, "load_stiffness": 100.0}


def chunk_of(**settings):
    return {point: {"settings": values, "first": 0, "stop": 3} for point, values in settings.items()}


def test_an_unstable_point_stops_the_job_if_failures_stop(tmp_path):
    """The file of a chunk is complete or does not appear."""
    with pytest.raises(UnstableLoopError, match="the closed loop is unstable") as caught:
        simulate_chunk(tmp_path / "trials.nc", "small", 3, chunk_of(good=STABLE, bad=UNSTABLE), failures="stop")
    assert caught.value.__notes__[0] == "study small, point bad, trial 0"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("order", "count"), [(("first", "bad", "last"), 3), (("bad", "first"), 3), (("bad",), 3)])
def test_an_unstable_point_becomes_failures_and_the_others_go_on(tmp_path, order, count):
    settings = {"first": STABLE, "bad": UNSTABLE, "last": STABLE | {"reflex_gain": 5.0}}
    path = tmp_path / "trials.nc"
    failed = simulate_chunk(path, "small", 3, chunk_of(**{point: settings[point] for point in order}))
    assert [(trial.point, trial.number) for trial in failed] == [("bad", number) for number in range(count)]
    for point in set(order) - {"bad"}:
        alone = tmp_path / f"{point}.nc"
        simulate_chunk(alone, "small", 3, chunk_of(**{point: settings[point]}))
        xr.testing.assert_identical(load_trial_of([path], point, 1), load_trial_of([alone], point, 1))
    with pytest.raises(DataError, match="trial 1 of the point 'bad' could not be simulated: the closed loop is"):
        load_trial_of([path], "bad", 1)

    methods = {"pr": {"method": "pr-moesp", "options": {"basis": "rectifier"}}}
    points = {point: {point: {"values": {"gain": 1.0}, "options": {}}} for point in order}
    results = identify_to(tmp_path, path, "small", points, methods)
    rows = results.parameters
    assert rows[["point", "trial"]].values.tolist() == [[point, number] for point in order for number in range(3)]
    assert (rows["failure"].notna() == (rows["point"] == "bad")).all()
    reason = rows.query("point == 'bad'")["failure"].iloc[0]
    assert reason.startswith("the trial could not be simulated: the closed loop is unstable")
    assert set(results.scores["point"]) == set(order) - {"bad"}


def test_one_trial_that_fails_among_others_of_its_point(tmp_path, monkeypatch):
    """The error names it, and no other is lost."""
    run_loop = simulation.run_loop

    def run_or_diverge(settings, joint, command, *torques):
        if np.array_equal(command, marked):
            raise UnstableLoopError("the closed loop is unstable")
        return run_loop(settings, joint, command, *torques)

    points = {"p": {"settings": STABLE, "first": 0, "stop": 20}}
    simulate_chunk(tmp_path / "all.nc", "small", 3, points)
    commands = []
    monkeypatch.setattr(simulation, "run_loop", lambda *args: commands.append(args[2]) or run_loop(*args))
    simulate_chunk(tmp_path / "all.nc", "small", 3, points)
    marked = commands[14]  # each trial runs twice
    monkeypatch.setattr(simulation, "run_loop", run_or_diverge)
    (failed,) = simulate_chunk(tmp_path / "some.nc", "small", 3, points)
    assert (failed.point, failed.number) == ("p", 7)
    (chunk,) = load_chunks(tmp_path / "some.nc")
    (whole,) = load_chunks(tmp_path / "all.nc")
    assert chunk.numbers == [number for number in range(20) if number != 7]
    for trial, expected in zip(chunk.trials, [*whole.trials[:7], *whole.trials[8:]], strict=True):
        assert trial.identical(expected)
