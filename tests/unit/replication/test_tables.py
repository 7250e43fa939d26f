"""Tables: errors against a bound, and single records with the interval of their VAF."""

import numpy as np
import pandas as pd
import pytest

from ankleloop.replication.tables import compare_with_bound, compare_with_published, format_table


def test_errors_of_known_estimators():
    rng = np.random.default_rng(1)
    estimates = 150.0 + 2.0 + 3.0 * rng.standard_normal(4000)
    details = pd.DataFrame(
        {"point": "p", "method": "m", "K": estimates, "K_low": estimates - 5.88, "K_high": estimates + 5.88}
    )
    details["B"] = np.nan
    table = compare_with_bound(details, {"p": {"K": 150.0, "B": 0.8, "G": 13.0}}, {("p", "m"): {"K": 3.0}})
    assert list(table["parameter"]) == ["K"]  # B has no value in any trial, G has no column
    row = table.iloc[0]
    assert row["bias"] == pytest.approx(2.0, abs=0.2)
    assert row["sd"] == pytest.approx(3.0, rel=0.05)
    assert row["rmse"] == pytest.approx(np.sqrt(13.0), rel=0.05)
    assert row["ratio"] == pytest.approx(row["rmse"] / 3.0)
    assert row["covered"] == pytest.approx(89.8, abs=2.0)  # P(|z + 2/3| < 1.96)
    without = compare_with_bound(details.drop(columns=["K_low", "K_high"]), {"p": {"K": 150.0}}, {("p", "m"): {}})
    assert np.isnan(without["covered"].iloc[0])
    assert np.isnan(without["ratio"].iloc[0])


def test_a_single_record_shows_its_interval():
    scores = pd.DataFrame(
        {
            "method": "m",
            "torque": ["net", "reflex"],
            "against": "measured",
            "vaf": [90.0, 30.0],
            "low": 88.0,
            "high": 91.5,
        }
    )
    published = pd.DataFrame({"method": ["m"], "torque": ["net"], "against": ["measured"], "paper": [85.0]})
    table = compare_with_published(scores, published, [])
    assert list(table.columns)[-2:] == ["low", "high"]
    shown = format_table(table, {"m": "M"})
    assert shown["ours [%], 95 % interval"].tolist() == ["90.0 (88.0 … 91.5)", "30.0 (88.0 … 91.5)"]
    several = compare_with_published(pd.concat([scores, scores]), published, [])
    assert "low" not in several
    assert format_table(several, {"m": "M"})["ours [%], mean ± sd"].tolist() == ["90.0 ± 0.00", "30.0 ± 0.00"]
