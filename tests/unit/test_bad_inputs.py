"""Whatever comes, a clear error or a right number: every row of the table of bad inputs."""

import pytest
from bad_inputs import read_table

ROWS = [pytest.param(row, id=f"{subject}: {row.wrong}") for subject, rows in read_table().items() for row in rows]


@pytest.mark.parametrize("row", ROWS)
def test_bad_input(row, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a relative path that is written by mistake lands there as well
    row.check(tmp_path)
