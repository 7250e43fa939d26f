"""Jobs that keep no trials: the numbers are those of trial files, and points of one condition share their trials."""

import gc

import numpy as np
import pandas as pd
import pytest

from ankleloop.joint.prepared import PreparedTrial
from ankleloop.paper.trial_tables import write_trial_table
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies import identification
from ankleloop.studies.identification import identify_chunk
from ankleloop.studies.simulation import simulate_chunk
from ankleloop.studies.study import read_studies
from ankleloop.studies.sweep_job import sweep_chunk

SETTINGS = SimulationSettings(duration=8.0, voluntary=0.1).model_dump()
UNSTABLE = {"reflex_gain": 30.0, "load_inertia": 0.1, "load_viscosity": 5.0, "load_stiffness": 100.0}
CONDITIONS = {
    "plain": {"settings": SETTINGS, "first": 0, "stop": 5},
    "bad": {"settings": SETTINGS | UNSTABLE, "first": 0, "stop": 2},
    "quiet": {"settings": SETTINGS | {"snr_db": None, "reflex_gain": 0.0}, "first": 3, "stop": 6},
}
METHODS = {
    "pr": {"method": "pr-moesp", "options": {"basis": "rectifier"}},
    "cascade": {"method": "parallel-cascade", "options": {"max_passes": 2}},
}
# Two points of each condition, which differ in an option of one method.
POINTS = {
    name: {
        f"{name},{rows}": {"values": {"gain": 1.0, "block_rows": rows}, "options": {"pr": {"block_rows": rows}}}
        for rows in (8, 10)
    }
    for name in CONDITIONS
}


def files_in(folder, *names):
    suffixes = {"estimates": "parquet", "scores": "csv", "parameters": "csv"}
    folder.mkdir()
    return {name: folder / f"{name}.{suffixes[name]}" for name in names}


@pytest.mark.parametrize("precision", ["double", "single"])
def test_numbers_do_not_depend_on_what_is_kept(tmp_path, precision):
    trials = tmp_path / "trials.nc"
    simulate_chunk(trials, "s", 1, CONDITIONS, precision)
    everything = files_in(tmp_path / "everything", "estimates", "scores", "parameters")
    identify_chunk(trials, everything, "s", POINTS, METHODS, precision=precision)
    for names in (("scores", "parameters"), ("estimates", "scores", "parameters")):
        files = files_in(tmp_path / str(len(names)), *names)
        failed = sweep_chunk(files, "s", 1, CONDITIONS, POINTS, METHODS, precision=precision)
        assert [(trial.point, trial.number) for trial in failed] == [("bad", 0), ("bad", 1)]
        for name, path in files.items():
            assert path.read_bytes() == everything[name].read_bytes(), name
        assert sorted(path.name for path in (tmp_path / str(len(names))).iterdir()) == sorted(
            path.name for path in files.values()
        )
    scores = pd.read_csv(everything["scores"])
    assert set(scores.query("point == 'quiet,8'")["torque"]) == {"net", "intrinsic"}


@pytest.mark.parametrize("keep", ["scores", "everything"])
def test_tables_of_all_trials_do_not_depend_on_the_chunks(tmp_path, keep):
    """1, 7 and 100 trials in a chunk give the same Parquet file and the same CSV file, byte for byte."""

    def make_tables(most):
        methods = {"pr": METHODS["pr"]}
        settings = {"kind": "simulation", "notebook": None, "trials": 9, "seed": 1, "simulation": {"duration": 8.0}}
        settings |= {"points": {"reflex_gain": [12.0, 8.0], "block_rows": [8, 10]}, "methods": methods}
        settings |= {"keep": keep, "trials_per_chunk": most}
        study = read_studies({"studies": {"s": settings}})[1]["s"]
        chunks = range(len(study.chunks))
        folders = [files_in(tmp_path / f"{most}-{chunk}", "scores", "parameters") for chunk in chunks]
        for chunk, files in zip(chunks, folders, strict=True):
            content = (study.identified_points(chunk), study.identified_methods)
            if keep == "scores":
                sweep_chunk(files, "s", 1, study.simulated_points(chunk), *content)
            else:
                trials = tmp_path / f"{most}-{study.trial_chunk_of(chunk)}.nc"
                if not trials.exists():
                    simulate_chunk(trials, "s", 1, study.simulated_points(study.trial_chunk_of(chunk), stored=True))
                identify_chunk(trials, files, "s", *content, trials=study.identified_trials(chunk))
        table, text = tmp_path / f"{most}.parquet", tmp_path / f"{most}.csv"
        parts = ([files[name] for files in folders] for name in ("parameters", "scores"))
        write_trial_table(table, *parts, study.varied, text=text, points=4, methods=["pr"], trials=9)
        return len(folders), table.read_bytes(), text.read_bytes()

    counts, *tables = zip(*map(make_tables, (1, 7, 100)), strict=True)
    assert counts == (18, 4, 2)
    assert all(len(set(files)) == 1 for files in tables)
    rows = pd.read_parquet(tmp_path / "100.parquet")[["reflex_gain", "trial", "block_rows"]]
    assert rows.values.tolist() == [[gain, k, size] for gain in (12.0, 8.0) for k in range(9) for size in (8, 10)]


def test_trials_of_different_length_share_a_chunk(tmp_path):
    settings = {"short": SETTINGS, "long": SETTINGS | {"duration": 9.0}, "fast": SETTINGS | {"recording_rate": 2000.0}}
    conditions = {name: {"settings": values, "first": 0, "stop": 2} for name, values in settings.items()}
    points = {name: {name: {"values": {}, "options": {}}} for name in settings}
    together = files_in(tmp_path / "together", "scores", "parameters")
    sweep_chunk(together, "s", 1, conditions, points, METHODS)
    rows = []
    for name in settings:
        alone = files_in(tmp_path / name, "scores", "parameters")
        sweep_chunk(alone, "s", 1, {name: conditions[name]}, {name: points[name]}, METHODS)
        rows.append(pd.read_csv(alone["scores"]))
    pd.testing.assert_frame_equal(pd.read_csv(together["scores"]), pd.concat(rows, ignore_index=True), check_exact=True)


def test_a_method_whose_options_are_the_same_identifies_a_trial_once(tmp_path, monkeypatch):
    calls = []
    identify = identification.identify

    def count(trial, method, **options):
        calls.append((method, options.get("block_rows")))
        return identify(trial, method, **options)

    monkeypatch.setattr(identification, "identify", count)
    conditions = {"plain": CONDITIONS["plain"] | {"stop": 2}}
    files = files_in(tmp_path / "files", "scores", "parameters")
    sweep_chunk(files, "s", 1, conditions, {"plain": POINTS["plain"]}, METHODS)
    assert calls == [("pr-moesp", 8), ("parallel-cascade", None), ("pr-moesp", 10)] * 2
    rows = pd.read_csv(files["parameters"])
    assert rows[["block_rows", "method", "trial"]].values.tolist() == [
        [block_rows, method, trial] for block_rows in (8, 10) for method in METHODS for trial in (0, 1)
    ]
    first, second = (
        rows[(rows["method"] == "cascade") & (rows["block_rows"] == block_rows)]["K"].tolist() for block_rows in (8, 10)
    )
    assert first == second
    first, second = (
        rows[(rows["method"] == "pr") & (rows["block_rows"] == block_rows)]["K"].to_numpy() for block_rows in (8, 10)
    )
    assert (first != second).all()


def test_a_parameter_of_the_sweep_keeps_its_column_beside_the_estimate_of_its_name(tmp_path):
    conditions = {
        f"delay={delay}": {"settings": SETTINGS | {"delay": delay, "duration": 15.0}, "first": 0, "stop": 1}
        for delay in (0.03, 0.05)
    }
    points = {name: {name: {"values": {"delay": float(name[6:])}, "options": {}}} for name in conditions}
    methods = {"riv": {"method": "riv", "options": {"delay": None}}}
    files = files_in(tmp_path / "files", "scores", "parameters")
    sweep_chunk(files, "s", 1, conditions, points, methods)
    rows = pd.read_csv(files["parameters"])
    assert rows["delay"].tolist() == [0.03, 0.05]
    np.testing.assert_allclose(rows["delay_estimated"], rows["delay"], atol=0.01)
    assert (rows["delay_estimated_low"] < rows["delay_estimated_high"]).all()


def test_a_condition_without_points_is_refused(tmp_path):
    """Its trials would be left out in silence."""
    files = files_in(tmp_path / "files", "scores", "parameters")
    with pytest.raises(ValueError, match="a condition has no points"):
        sweep_chunk(files, "s", 1, CONDITIONS, {**POINTS, "plain": {}}, METHODS)
    assert not list((tmp_path / "files").iterdir())


def test_no_trial_waits_for_the_search_for_reference_cycles(tmp_path):
    """It holds all of its samples, and the search comes after thousands of trials."""
    gc.collect()
    before = sum(isinstance(item, PreparedTrial) for item in gc.get_objects())
    gc.disable()
    try:
        conditions = {"plain": CONDITIONS["plain"]}
        sweep_chunk(files_in(tmp_path / "files", "scores", "parameters"), "s", 1, conditions, POINTS, METHODS)
        assert sum(isinstance(item, PreparedTrial) for item in gc.get_objects()) <= before
    finally:
        gc.enable()
