"""What a comparison of two folders of results sees, and what it lets pass."""

import pandas as pd
import pytest
from compare_results import compare_folders

TABLE = pd.DataFrame({"K": [150.0, 1e-8, float("nan")], "verdict": ["holds", "open", ""]})


@pytest.fixture
def folders(tmp_path):
    for name in ("before", "after"):
        (tmp_path / name).mkdir()
        TABLE.to_parquet(tmp_path / name / "table.parquet")
    return tmp_path / "before", tmp_path / "after"


@pytest.mark.parametrize(
    ("column", "row", "value", "is_seen"),
    [
        ("K", 0, 150.0001, False),  # within 1e-6 of itself
        ("K", 0, 150.001, True),
        ("K", 1, 1.1e-8, False),  # within 1e-9 of the largest
        ("K", 1, 1.0, True),
        ("K", 2, 0.0, True),
        ("verdict", 1, "holds", True),
    ],
)
def test_a_changed_cell(folders, column, row, value, is_seen):
    table = TABLE.copy()
    table.loc[row, column] = value
    table.to_parquet(folders[1] / "table.parquet")
    differences, count = compare_folders(*folders)
    assert bool(differences) == is_seen
    assert count == 3


def test_a_missing_file_and_numbers_within_text(folders):
    pd.DataFrame({"model": ['{"A": [1.0, 2.0]}']}).to_csv(folders[0] / "one.csv", index=False)
    assert compare_folders(*folders)[0] == ["one.csv: in one folder alone"]
    pd.DataFrame({"model": ['{"A": [1.0, 2.1]}']}).to_csv(folders[1] / "one.csv", index=False)
    assert "2.0" in compare_folders(*folders)[0][0]
