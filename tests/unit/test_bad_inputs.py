"""Whatever comes, a clear error or a right number: every row of the table of bad inputs."""

from importlib import import_module

import pytest

SUBJECTS = (
    "csv_files",
    "containers",
    "flb_files",
    "trials",
    "identification",
    "saved_files",
    "configs",
    "experiments",
)
SUBJECTS += ("data", "commands", "units")
TABLE = {name: import_module(f"bad_inputs.{name}").ROWS for name in SUBJECTS}


@pytest.mark.parametrize(
    "row",
    [
        pytest.param(row, id=f"{subject}: {row.wrong}")
        for subject, rows in TABLE.items()
        for row in rows
    ],
)
def test_bad_input(row, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a relative path that is written by mistake lands there as well
    row.check(tmp_path)
