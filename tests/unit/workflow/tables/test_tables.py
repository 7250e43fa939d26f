"""Tables: errors against a bound, means with their intervals, numbers beside the paper."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from ankleloop_workflow.tables.comparisons import (
    compare_with_bound,
    compare_with_published,
    format_means,
    format_rows,
    format_table,
)


def test_errors_of_known_estimators():
    rng = np.random.default_rng(1)
    estimates = 150.0 + 2.0 + 3.0 * rng.standard_normal(4000)
    details = pd.DataFrame(
        {
            "point": "p",
            "method": "m",
            "K": estimates,
            "K_low": estimates - 5.88,
            "K_high": estimates + 5.88,
        }
    )
    details["trial"] = range(4000)
    details["B"] = np.nan
    table = compare_with_bound(
        details, {"p": {"K": 150.0, "B": 0.8, "G": 13.0}}, {("p", "m"): {"K": 3.0}}
    )
    assert list(table["parameter"]) == ["K"]  # B has no value in any trial, G has no column
    row = table.iloc[0]
    assert row["bias"] == pytest.approx(2.0, abs=0.2)
    assert row["sd"] == pytest.approx(3.0, rel=0.05)
    assert row["rmse"] == pytest.approx(np.sqrt(13.0), rel=0.05)
    assert row["ratio"] == pytest.approx(row["rmse"] / 3.0)
    assert row["covered"] == pytest.approx(89.8, abs=2.0)  # P(|z + 2/3| < 1.96)


def test_means_stand_with_half_of_their_interval():
    summary = pd.DataFrame(
        {"K_mean": [153.0, 150.0, np.nan], "K_std": [3.0, np.nan, np.nan], "K_count": [9, 1, 0]}
    )
    margin = stats.t.ppf(0.975, 8)  # times sd / sqrt(9) = 1
    assert format_means(summary, "K", "{:.2f} ± {:.2f}") == [
        f"153.00 ± {margin:.2f}",
        "150.00 ± –",
        "–",
    ]
    errors = format_means(summary, "K", "{:+.1f} ± {:.2f}", truth=pd.Series([150.0, 150.0, 150.0]))
    assert errors == [f"+2.0 ± {margin / 1.5:.2f}", "+0.0 ± –", "–"]


def test_rows_of_a_table_as_text():
    """What has no value is a dash, a name that holds "nan" is none; an interval that is not there is left out."""
    table = pd.DataFrame({"method": ["dominant", "riv"], "K": [1.0, np.nan], "sd": np.nan})
    columns = {
        "method": "{method}",
        "error": "{K:+.1f} ± {sd:.1f}",
        "interval": "{K:g} ({sd:g} … {sd:g})",
        "paper": "{sd:g} → {K:.1f}",
        "empty": "{sd:.1f}",
        "absent": "{G:.1f}",
    }
    cells = format_rows(table, columns)
    assert list(cells) == list(columns)
    assert cells.loc[0].to_list() == ["dominant", "+1.0", "1", "– → 1.0", "–", "–"]
    assert cells.loc[1].to_list() == ["riv", "–", "–", "– → –", "–", "–"]


@pytest.fixture
def partly_failed():
    """Four trials of two methods; one method fails at one point in every trial, and elsewhere in one of them."""
    rows = []
    for point in ("p", "q"):
        for method in ("a", "b"):
            for trial in range(4):
                key = {"point": point, "method": method, "trial": trial}
                if method == "b" and (point == "q" or trial == 3):
                    rows.append(key | {"failure": "no pole"})
                    continue
                values = {"K": 150.0 + trial, "vaf_net_true": 90.0 + trial}
                rows.append(key | values | {"warnings": "slow" if trial == 0 else ""})
    return pd.DataFrame(rows)


def test_a_table_beside_the_paper_says_how_many_trials_failed(partly_failed):
    published = pd.DataFrame(
        {"method": ["a"], "torque": ["net"], "against": ["true"], "paper": [91.0]}
    )
    table = compare_with_published(partly_failed, published, ["point"])
    counts = table.set_index(["point", "method"])[["n", "trials", "failures", "warnings"]]
    assert counts.values.tolist() == [[4, 4, 0, 1], [3, 4, 1, 1], [4, 4, 0, 1], [0, 4, 4, 0]]
    assert table["mean"].tolist()[:3] == [91.5, 91.0, 91.5]
    assert np.isnan(table["mean"].iloc[3])
    shown = format_table(table, {"a": "A", "b": "B"})
    assert shown[["trials", "failures", "warnings"]].values.tolist()[3] == [4, 4, 0]
    assert shown["ours [%]"].iloc[3] == "–"
    assert shown["ours [%]"].iloc[0].startswith("91.5 ± ")
