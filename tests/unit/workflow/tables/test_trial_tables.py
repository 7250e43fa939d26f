"""The table of all trials of a study: types of its columns, and refusal of what is not whole."""

from importlib.metadata import version

import pandas as pd
import pytest
from pyarrow import parquet
from study_jobs import run_jobs

from ankleloop import DataError
from ankleloop.methods.registry import JOINT_METHODS
from ankleloop_workflow.config.study import read_studies
from ankleloop_workflow.jobs.results import report_versions
from ankleloop_workflow.tables import trial_tables
from ankleloop_workflow.tables.trial_tables import (
    join_tables,
    read_results,
    read_trial_table,
    save_table,
)

UNSTABLE = {"load_inertia": 0.1, "load_viscosity": 5.0, "load_stiffness": 100.0}
POINTS = [
    {"reflex_gain": 13.0, "voluntary": 0.3, "block_rows": 12},
    {"reflex_gain": 0.0, "snr_db": None, "closed_loop": False, "riv.basis": "spline"},
    {"reflex_gain": 30.0, **UNSTABLE},
]
VARIED = ["reflex_gain", "voluntary", "block_rows", "snr_db", "closed_loop", "riv.basis", *UNSTABLE]


def read_study(**changes):
    study = {
        "kind": "simulation",
        "notebook": None,
        "seed": 1,
        "trials": 2,
        "trials_per_chunk": 2,
        "keep": "scores",
    }
    study |= {"simulation": {"duration": 15.0}, "points": POINTS}
    study |= {"methods": {name: {"method": name} for name in JOINT_METHODS}, **changes}
    return read_studies({"studies": {"small": study}})[1]["small"]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Chunks of three points by every method: with noise, without a reflex and noise, and with an unstable loop."""
    return run_jobs(read_study(), tmp_path_factory.mktemp("chunks"))


@pytest.fixture(scope="module")
def table(results):
    return results.table


def test_types_of_columns(table):
    schema = parquet.read_schema(table)
    types = {field.name: str(field.type) for field in schema}
    assert {types[name] for name in ("trial", "order", "passes", "point.block_rows")} == {"int64"}
    assert {types[name] for name in ("K", "point.snr_db")} == {"double"}
    assert {types[name] for name in ("point.closed_loop", "stable")} == {"bool"}
    assert {types[name] for name in ("point.riv.basis", "failure")} == {"string"}


def test_failures_have_rows_without_numbers(table):
    rows = read_trial_table(table)
    assert isinstance(rows["point"].dtype, pd.CategoricalDtype)
    failed = rows[rows["point.reflex_gain"] == 30.0]
    assert failed["failure"].str.contains("the closed loop is unstable").all()
    assert failed[["K", "vaf_net_true"]].isna().all(axis=None)
    scores = (
        read_results(table)
        .query("`point.reflex_gain` == 0")
        .filter(like="vaf_")
        .dropna(axis="columns", how="all")
    )
    assert set(scores) == {"vaf_net_measured", "vaf_net_true", "vaf_intrinsic_true"}


def test_text_file_has_the_same_cells(table):
    rows, text = read_trial_table(table), pd.read_csv(table.with_suffix(".csv"))
    assert list(text.columns) == list(rows.columns)
    for name in rows:
        values = rows[name].astype(text[name].dtype) if rows[name].notna().all() else rows[name]
        assert all(
            a == b or (pd.isna(a) and pd.isna(b)) for a, b in zip(values, text[name], strict=True)
        ), name


def test_text_that_a_spreadsheet_would_compute_gets_a_quote(tmp_path):
    point = [{"riv.reference": "position"}]
    study = read_study(
        points=point,
        methods={"riv": {"method": "riv", "label": "=1+1"}},
        simulation={"duration": 12.0},
    )
    study.name = "=small"
    run_jobs(study, tmp_path)
    assert (
        (tmp_path / "=small-trials.csv")
        .read_text(encoding="utf-8")
        .splitlines()[1]
        .startswith("'=small,")
    )
    assert set(read_trial_table(tmp_path / "=small-trials.parquet")["study"]) == {"=small"}


def test_missing_rows_and_missing_files_are_refused(results, tmp_path):
    files = (tmp_path / "t.parquet", tmp_path / "t.csv")
    with pytest.raises(DataError, match=r"have 54 of 55 rows"):
        join_tables(*files, results.scores, rows=55)
    with pytest.raises(DataError, match="there is no such file"):
        join_tables(*files, [tmp_path / "scores-9.parquet"], rows=1)
    assert not list(tmp_path.iterdir())


def test_a_table_carries_the_versions_that_made_its_parts(results, tmp_path, monkeypatch):
    """Parts that two versions of SciPy have made: the provenance of the run names both, and not what is installed."""
    installed = {"numpy": "1", "scipy": "9.9", "numba": "1", "control": "1"}
    monkeypatch.setattr(trial_tables, "read_versions", lambda: installed)
    first, *others = results.scores
    save_table(parquet.read_table(first), tmp_path / "0.parquet")
    files = (tmp_path / "t.parquet", tmp_path / "t.csv")
    join_tables(*files, [tmp_path / "0.parquet", *others], rows=54)
    packages = {"numpy": "3", "pandas": "4"}
    reported = report_versions({"packages": packages}, [tmp_path / "t.parquet"])["packages"]
    assert reported["scipy"] == f"{version('scipy')} and 9.9"
    assert reported["pandas"] == "4"


def test_a_study_without_any_estimate_is_refused_with_a_reason(tmp_path):
    match = r"no trial .* by any method: the trial could not be simulated: the closed loop"
    with pytest.raises(DataError, match=match):
        run_jobs(read_study(points=POINTS[2:]), tmp_path)


def test_a_damaged_table_is_refused(table, tmp_path):
    data = bytearray(table.read_bytes())
    start = len(data) // 5
    data[start : start + 40] = bytes(255 - byte for byte in data[start : start + 40])
    for content in (data, data[:-100]):
        (tmp_path / "t.parquet").write_bytes(content)
        with pytest.raises(DataError, match=r"t\.parquet: not a readable table of trials"):
            read_trial_table(tmp_path / "t.parquet")
