"""The table of all trials of a study: the numbers of its chunks, their types, and refusal of what is not whole."""

import csv
import re

import pandas as pd
import pytest
from pyarrow import parquet

from ankleloop import DataError
from ankleloop.methods.registry import METHODS
from ankleloop.paper.trial_columns import column_kind
from ankleloop.paper.trial_tables import read_trial_table, trial_table_columns, write_trial_table
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.sweep_job import sweep_chunk

VARIED = ["reflex_gain", "basis", "snr_db", "closed_loop", "block_rows"]
METHODS_OF_STUDY = {name: {"method": name, "options": {}} for name in METHODS}


def make_chunk(folder, number, gain, trials=2, **settings):
    settings = SimulationSettings(duration=15.0, reflex_gain=gain, **settings).model_dump()
    name = f"gain={gain}"
    values = {"reflex_gain": gain, "basis": "rectifier" if gain else "spline", "snr_db": settings["snr_db"]}
    values |= {"closed_loop": settings["closed_loop"], "block_rows": 12}
    files = {kind: folder / f"{kind}-{number}.csv" for kind in ("scores", "parameters")}
    sweep_chunk(
        files,
        "small",
        1,
        {name: {"settings": settings, "first": 0, "stop": trials}},
        {name: {name: {"values": values, "options": {}}}},
        METHODS_OF_STUDY,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Chunks of three points by every method: without a reflex, without noise, and with a loop that is unstable."""
    folder = tmp_path_factory.mktemp("chunks")
    make_chunk(folder, 0, 13.0, voluntary=0.3)
    make_chunk(folder, 1, 0.0, snr_db=None, closed_loop=False)
    make_chunk(folder, 2, 30.0, load_inertia=0.1, load_viscosity=5.0, load_stiffness=100.0)
    return folder


def files_of(folder, kind):
    return sorted(folder.glob(f"{kind}-*.csv"))


def write(folder, path, varied=VARIED, **expected):
    write_trial_table(path, files_of(folder, "parameters"), files_of(folder, "scores"), varied, **expected)


@pytest.fixture(scope="module")
def table(folder, tmp_path_factory):
    path = tmp_path_factory.mktemp("tables") / "small-trials.parquet"
    write(folder, path, text=path.with_suffix(".csv"), points=3, methods=list(METHODS), trials=2)
    return path


def test_numbers_are_those_of_the_chunks(folder, table):
    """Digit by digit, against the text of the files of the chunks."""
    rows = read_trial_table(table)
    assert len(rows) == 3 * len(METHODS) * 2
    index = {key: row for row, key in enumerate(zip(rows["point"], rows["method"], rows["trial"], strict=True))}
    compared = 0
    for kind in ("parameters", "scores"):
        for path in files_of(folder, kind):
            for cells in csv.DictReader(path.open(newline="")):
                row = rows.iloc[index[cells["point"], cells["method"], int(cells["trial"])]]
                if kind == "scores":
                    name = f"vaf_{cells['torque']}_{cells['against']}"
                    cells = {name: cells["vaf"], f"{name}_low": cells["low"], f"{name}_high": cells["high"]}
                for name, text in cells.items():
                    if not text:
                        assert pd.isna(row[name]), name
                    elif column_kind(name) == "number" and name not in ("basis", "closed_loop"):
                        assert float(row[name]) == float(text), name
                    elif column_kind(name) == "count":
                        assert int(row[name]) == int(text), name
                    else:
                        assert str(row[name]) == text, name
                    compared += 1
    assert compared > 1000


def test_types_units_and_order_of_columns(table):
    schema = parquet.read_schema(table)
    assert schema.names == trial_table_columns(table)
    assert schema.names[: len(VARIED) + 5] == ["study", "point", *VARIED, "method", "trial", "vaf_net_true"]
    assert schema.names[-2:] == ["failure", "warnings"]
    assert schema.names.index("K") + 1 == schema.names.index("K_low")
    types = {field.name: str(field.type) for field in schema}
    assert {types[name] for name in ("trial", "order", "passes", "block_rows")} == {"int64"}
    assert {types[name] for name in ("K", "G_high", "reflex_gain", "snr_db", "vaf_net_true_low")} == {"double"}
    assert {types[name] for name in ("closed_loop", "stable", "converged")} == {"bool"}
    assert all(types[name].startswith("dictionary") for name in ("point", "basis", "failure", "warnings", "intervals"))
    units = {field.name: field.metadata[b"unit"].decode() for field in schema}
    assert (units["K_low"], units["reflex_gain"], units["vaf_net_true"]) == ("N·m/rad", "N·m·s/rad", "%")
    assert all(field.metadata[b"description"] for field in schema)


def test_failures_have_rows_without_numbers(table):
    rows = read_trial_table(table).query("point == 'gain=30.0'")
    assert rows["failure"].str.contains("the closed loop is unstable").all()
    assert rows[["K", "vaf_net_true"]].isna().all(axis=None)


def test_text_file_has_the_same_cells(table):
    rows, text = read_trial_table(table), pd.read_csv(table.with_suffix(".csv"))
    assert list(text.columns) == list(rows.columns)
    for name in rows:
        values = rows[name].astype(text[name].dtype) if rows[name].notna().all() else rows[name]
        assert all(a == b or (pd.isna(a) and pd.isna(b)) for a, b in zip(values, text[name], strict=True)), name


def test_groups_of_rows_change_nothing(folder, table, tmp_path, monkeypatch):
    monkeypatch.setattr("ankleloop.paper.trial_tables.GROUP_ROWS", 5)
    write(folder, tmp_path / "t.parquet")
    assert parquet.ParquetFile(tmp_path / "t.parquet").num_row_groups == -(-3 * len(METHODS) * 2 // 5)
    pd.testing.assert_frame_equal(read_trial_table(tmp_path / "t.parquet"), read_trial_table(table), check_exact=True)


def copy_chunks(folder, target):
    for path in folder.glob("*.csv"):
        (target / path.name).write_bytes(path.read_bytes())


CHANGES = {
    "no end": (lambda text: text[:-30], "the table is damaged|not a readable table"),
    "a row less": (lambda text: text[: text[:-1].rindex("\n") + 1], "has 1 of 2 trials|a score is missing"),
    "a cell too many": (lambda text: text[:-1] + ",7\n", "not a readable table"),
    "text for a number": (lambda text: re.sub(r"(?m)^(.*),\d+\.\d+", r"\1,x", text), "not a readable table"),
    "empty": (lambda text: "", "not a readable table"),
    "a row twice": (lambda text: text + text[text[:-1].rindex("\n") + 1 :], "trials|twice"),
}


@pytest.mark.parametrize("kind", ["parameters", "scores"])
@pytest.mark.parametrize("change", CHANGES)
def test_a_damaged_chunk_is_refused_and_leaves_no_table(folder, tmp_path, kind, change):
    copy_chunks(folder, tmp_path)
    path = tmp_path / f"{kind}-0.csv"
    edit, message = CHANGES[change]
    path.write_text(edit(path.read_text()))
    (tmp_path / "old.parquet").write_text("old")
    with pytest.raises(DataError, match=message):
        write(tmp_path, tmp_path / "old.parquet", points=3, methods=list(METHODS), trials=2)
    assert (tmp_path / "old.parquet").read_text() == "old"
    assert not list(tmp_path.glob(".*"))


def test_a_missing_chunk_and_missing_points_are_refused(folder, tmp_path):
    copy_chunks(folder, tmp_path)
    for kind in ("parameters", "scores"):
        (tmp_path / f"{kind}-2.csv").unlink()
    with pytest.raises(DataError, match="there are 2 of 3 points"):
        write(tmp_path, tmp_path / "t.parquet", points=3)
    with pytest.raises(DataError, match="there is no such file"):
        write_trial_table(tmp_path / "t.parquet", [tmp_path / "parameters-9.csv"], [tmp_path / "scores-9.csv"])


def test_a_study_without_any_estimate_is_refused_with_a_reason(folder, tmp_path):
    for kind in ("parameters", "scores"):
        (tmp_path / f"{kind}-0.csv").write_bytes((folder / f"{kind}-2.csv").read_bytes())
    with pytest.raises(
        DataError, match=r"no trial .* by any method: the trial could not be simulated: the closed loop"
    ):
        write(tmp_path, tmp_path / "t.parquet")


@pytest.mark.parametrize("place", [0.0, 0.5, 0.98])
def test_a_damaged_table_is_refused(table, tmp_path, place):
    data = bytearray(table.read_bytes())
    start = int(place * len(data))
    data[start : start + 40] = bytes(255 - byte for byte in data[start : start + 40])
    (tmp_path / "t.parquet").write_bytes(data)
    with pytest.raises(DataError, match=r"t\.parquet: not a readable table of trials"):
        read_trial_table(tmp_path / "t.parquet")
    (tmp_path / "t.parquet").write_bytes(table.read_bytes()[:-100])
    with pytest.raises(DataError, match="not a readable table of trials"):
        trial_table_columns(tmp_path / "t.parquet")


def test_an_unknown_column_is_refused(table):
    with pytest.raises(DataError, match=r"there is no column 'stiffness'; there are study, point"):
        read_trial_table(table, ["stiffness"])
